//! `documentation/` of an FMU: what it is, its variables, how to use it, whose work is inside.

use crate::cargo::Dependency;
use crate::description::{causality, variability};
use crate::package::{Package, PackageError};
use crate::standard::Standard;
use crate::xml::{Attributes, Xml};
use rfl_mpc::fmi::{Causality, Declaration, Initial, Variable, VariableKind, VersionedVariable};
use std::path::Path;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:70em;margin:2em auto;padding:0 1em}\
table{border-collapse:collapse;margin:1em 0}td,th{border:1px solid #ccc;padding:.2em .6em;text-align:left;\
vertical-align:top}th{background:#f2f2f2}code,pre{background:#f6f6f6}pre{padding:1em}";

/// Meaning of statuses here, in the words of a host's user.
const STATUSES: [(&str, &str); 4] = [
    ("fmiOK", "Done. The log has a warning where there is something to look at."),
    (
        "fmiWarning",
        "Only if mpc.report_warnings is true: done, but look at the message. An input is outside the range in which it \
         can be right, or the model warns. Otherwise such a call returns fmiOK, and the log has the message.",
    ),
    (
        "fmiDiscard",
        "A value was not taken (not finite, but for a controller's measurement; outside a parameter's range; no UTF-8): the value before stands, try \
         another. From fmiDoStep: the step was not made; {}",
    ),
    (
        "fmiError",
        "The call was wrong (order, reference, type, pointer, communication point) and has changed nothing, or the \
         model failed: then call fmiReset or restore an FMU state. The message says which, and what to do.",
    ),
];

/// The page of an FMU in its package.
pub const INDEX: &str = "documentation/index.html";

/// Adds the licences to a package: ours, those of linked crates, and a page that lists them.
///
/// # Errors
/// If a licence file cannot be read.
pub fn license(package: &mut Package, own_license: &Path, linked: &[Dependency]) -> Result<(), PackageError> {
    for (name, text) in license_texts(own_license, linked)? {
        package.add(format!("documentation/licenses/{name}"), text)?;
    }
    Ok(())
}

/// The same as files, by name.
///
/// # Errors
/// If a licence file cannot be read.
pub fn license_texts(
    own_license: &Path,
    linked: &[Dependency],
) -> Result<Vec<(String, Vec<u8>)>, PackageError> {
    let read = |path: &Path| {
        std::fs::read(path).map_err(|source| PackageError::Read { path: path.to_owned(), source })
    };
    let mut texts = vec![
        // The name that the standard has for the entry point.
        ("license.html".to_owned(), licenses(linked).into_bytes()),
        ("LICENSE.txt".to_owned(), read(own_license)?),
    ];
    for dependency in linked {
        for file in &dependency.files {
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            texts.push((format!("{}-{}/{name}", dependency.name, dependency.version), read(file)?));
        }
    }
    Ok(texts)
}

/// A page with its head and its title.
fn page(title: &str) -> Xml {
    let mut html = Xml::fragment();
    html.open("html", Attributes::new().with("lang", "en"));
    html.open("head", Attributes::new());
    html.empty("meta", Attributes::new().with("charset", "utf-8"));
    html.text("title", title);
    html.text("style", STYLE);
    html.close();
    html.open("body", Attributes::new());
    html.text("h1", title);
    html
}

fn finish(mut html: Xml) -> String {
    html.close();
    html.close();
    format!("<!DOCTYPE html>\n{}", html.finish())
}

/// Page of an FMU: what it is and needs, its variables, how it is used. `platforms` are FMI's names with what the library
/// for each needs.
#[must_use]
pub fn index(standard: Standard, declaration: &Declaration, platforms: &[(&str, String)]) -> String {
    let mut html = page(declaration.name);
    html.text("p", declaration.description);
    html.text(
        "p",
        &format!(
            "An FMI {} unit for co-simulation. SI units and radians; ISO 8855 axes (x forward, y left, z up); steering \
             and yaw are positive to the left.",
            standard.number()
        ),
    );
    html.text("p", "Its libraries, by FMI's names of the platforms:");
    let rows = platforms.iter().map(|(platform, needs)| vec![(*platform).to_owned(), needs.clone()]);
    table(&mut html, &["platform", "what the library needs"], rows);

    html.text("h2", "Use");
    html.text("p", "In Python with FMPy:");
    let experiment = &declaration.experiment;
    html.text(
        "pre",
        &format!(
            "from fmpy import simulate_fmu\nresult = simulate_fmu(\"{}.fmu\", stop_time={}, output_interval={})",
            declaration.name, experiment.stop_time, experiment.step_size
        ),
    );
    html.text(
        "p",
        "Any communication step is allowed and may vary; inputs hold over a step, outputs change at its end. \
         Parameters that name files take an absolute path or a file in resources/; a parameter that the host sets to \
         another value than its start wins over the file's. FMU states can be stored, restored and serialised at any time. Any number of \
         instances may run, each on any thread. The library uses its own memory, never the host's callbacks.",
    );

    html.text("h2", "Variables");
    let mut declaration = declaration.clone();
    declaration.complete(standard.version());
    let shown = declaration.shown(standard.version());
    for (title, wanted) in
        [("Inputs", Causality::Input), ("Outputs", Causality::Output), ("Parameters", Causality::Parameter)]
    {
        let chosen: Vec<_> = shown.iter().filter(|shown| shown.variable.causality == wanted).collect();
        if !chosen.is_empty() {
            html.text("h3", title);
            variables(&mut html, standard, &chosen);
        }
    }

    let version = standard.version();
    let (after_discarded, told) = match standard {
        Standard::Fmi2 => {
            ("restore an FMU state and step differently.", "Messages of a warning or worse are always told.")
        }
        Standard::Fmi3 => (
            "the instance is as it was, step differently.",
            "Messages are told to a host that asks for them: by loggingOn, or fmi3SetDebugLogging.",
        ),
    };
    html.text("h2", "Status codes");
    table(
        &mut html,
        &["status", "meaning"],
        STATUSES.map(|(status, meaning)| {
            let meaning = meaning.replace("{}", after_discarded);
            vec![version.words(status), version.words(&meaning)]
        }),
    );

    html.text("h2", "Log categories");
    let categories = rfl_mpc::fmi::logger::STANDARD_CATEGORIES.iter().chain(declaration.log_categories);
    let rows = categories.map(|category| vec![category.name.to_owned(), version.words(category.description)]);
    table(&mut html, &["category", "what it tells"], rows);
    html.text("p", told);

    html.text("h2", "Licences");
    html.text(
        "p",
        "Ours, and those of the libraries that are linked in, with their texts: licenses/license.html.",
    );
    finish(html)
}

/// Page of licences.
fn licenses(linked: &[Dependency]) -> String {
    let mut html = page("Licences");
    let ours = concat!("Our own work: ", env!("CARGO_PKG_LICENSE"), ", ", env!("CARGO_PKG_AUTHORS"));
    html.text("p", &format!("{ours}; the text is in LICENSE.txt. These libraries are linked in:"));
    let rows = linked.iter().map(|dependency| {
        vec![
            dependency.name.clone(),
            dependency.version.clone(),
            dependency.license.clone(),
            dependency.repository.clone(),
        ]
    });
    table(&mut html, &["library", "version", "licence", "source"], rows);
    finish(html)
}

fn variables(html: &mut Xml, standard: Standard, variables: &[&VersionedVariable<'_>]) {
    let rows = variables.iter().map(|VersionedVariable { variable, size, .. }| {
        let (unit, start, range) = columns(variable);
        let start = if variable.initial == Initial::Exact { start } else { String::new() };
        let kind = format!("{} {}", variability(variable), causality(variable));
        let meaning = standard.version().words(&variable.description);
        let size = size.map(|size| format!("[{size}]")).unwrap_or_default();
        vec![format!("{}{size}", variable.name), unit, start, range, kind, meaning]
    });
    table(html, &["name", "unit or type", "start", "range", "kind", "meaning"], rows);
}

/// Unit or type, start value, and range of a variable.
fn columns(variable: &Variable) -> (String, String, String) {
    let range = |low: Option<String>, high: Option<String>| match (low, high) {
        (None, None) => String::new(),
        (low, high) => format!("{} … {}", low.unwrap_or_default(), high.unwrap_or_default()),
    };
    match &variable.kind {
        VariableKind::Real { unit, start, min, max, .. } => (
            unit.symbol.to_owned(),
            start.to_string(),
            range(min.map(|min| min.to_string()), max.map(|max| max.to_string())),
        ),
        VariableKind::Integer { start, min, max } => (
            "integer".to_owned(),
            start.to_string(),
            range(min.map(|min| min.to_string()), max.map(|max| max.to_string())),
        ),
        VariableKind::Boolean { start } => ("boolean".to_owned(), start.to_string(), String::new()),
        VariableKind::String { start } => ("text".to_owned(), start.to_string(), String::new()),
        VariableKind::Binary { max_size } => {
            ("bytes".to_owned(), String::new(), format!("at most {max_size} bytes"))
        }
        VariableKind::Enumeration { items, start, .. } => {
            let items: Vec<_> =
                items.iter().map(|(value, name, meaning)| format!("{value} {name}: {meaning}")).collect();
            ("enumeration".to_owned(), start.to_string(), items.join("; "))
        }
    }
}

fn table(html: &mut Xml, titles: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    html.open("table", Attributes::new());
    html.open("tr", Attributes::new());
    for title in titles {
        html.text("th", title);
    }
    html.close();
    for row in rows {
        html.open("tr", Attributes::new());
        for cell in row {
            html.text("td", &cell);
        }
        html.close();
    }
    html.close();
}
