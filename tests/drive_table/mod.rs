//! A drive log as a table that tests damage: fields as text, as a file has them.

use rfl_mpc::log::DriveLog;
use std::path::{Path, PathBuf};

#[derive(Clone)]
pub struct DriveTable {
    pub names: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl DriveTable {
    pub fn new(names: &[&str], rows: Vec<Vec<f64>>) -> Self {
        let text = |row: Vec<f64>| row.iter().map(f64::to_string).collect();
        let names = names.iter().map(|&name| name.to_owned()).collect();
        Self { names, rows: rows.into_iter().map(text).collect() }
    }

    pub fn read(file: &Path) -> Self {
        let text = std::fs::read_to_string(file).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
        Self { names: lines.next().unwrap(), rows: lines.collect() }
    }

    pub fn place(&self, name: &str) -> usize {
        self.names.iter().position(|other| other == name).unwrap_or_else(|| panic!("no column {name}"))
    }

    /// Changes a column's numbers, each by its row.
    pub fn map(mut self, name: &str, change: impl Fn(usize, f64) -> f64) -> Self {
        let place = self.place(name);
        for (i, row) in self.rows.iter_mut().enumerate() {
            row[place] = change(i, row[place].parse().unwrap()).to_string();
        }
        self
    }

    /// Adds a column, each value made of the row's others.
    pub fn and(mut self, name: &str, make: impl Fn(&dyn Fn(&str) -> f64) -> f64) -> Self {
        let values: Vec<f64> =
            self.rows.iter().map(|row| make(&|other| row[self.place(other)].parse().unwrap())).collect();
        self.names.push(name.to_owned());
        self.rows.iter_mut().zip(values).for_each(|(row, value)| row.push(value.to_string()));
        self
    }

    pub fn scaled(self, names: &[&str], factor: f64) -> Self {
        names.iter().fold(self, |table, name| table.map(name, |_, value| factor * value))
    }

    pub fn set(mut self, name: &str, rows: std::ops::Range<usize>, to: &str) -> Self {
        let place = self.place(name);
        self.rows[rows].iter_mut().for_each(|row| row[place] = to.to_owned());
        self
    }

    pub fn without(mut self, names: &[&str]) -> Self {
        for name in names {
            let place = self.place(name);
            self.names.remove(place);
            self.rows.iter_mut().for_each(|row| drop(row.remove(place)));
        }
        self
    }

    pub fn rows(mut self, change: impl Fn(Vec<Vec<String>>) -> Vec<Vec<String>>) -> Self {
        self.rows = change(self.rows);
        self
    }

    pub fn keep(self, which: impl Fn(usize) -> bool) -> Self {
        self.rows(|rows| {
            rows.into_iter().enumerate().filter(|(i, _)| which(*i)).map(|(_, row)| row).collect()
        })
    }

    pub fn text(&self) -> String {
        let lines = std::iter::once(&self.names).chain(&self.rows).map(|row| row.join(","));
        lines.collect::<Vec<_>>().join("\n") + "\n"
    }

    /// Writes it as `log.csv`.
    pub fn write(&self, folder: &Path) -> PathBuf {
        let file = folder.join("log.csv");
        std::fs::write(&file, self.text()).unwrap();
        file
    }

    pub fn log(&self) -> DriveLog {
        DriveLog::from_reader(self.text().as_bytes(), Path::new("a.csv")).unwrap()
    }
}
