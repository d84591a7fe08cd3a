//! The decimal mark of a file, and its fields with decimal points.

use std::borrow::Cow;

/// The decimal mark of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Decimal {
    Point,
    Comma,
    /// The head has whole numbers alone, and no commas between them: either.
    Unknown,
}

impl Decimal {
    /// A field with a decimal point. A point in a file with decimal commas may separate thousands. The field is then
    /// returned with words after it, so that it is no number.
    pub fn plain(self, field: &str) -> Cow<'_, str> {
        if let Some(joined) = without_apostrophes(field) {
            return self.plain(&joined).into_owned().into();
        }
        if let Some(plain) = without_thousands(self, field) {
            return plain.into();
        }
        match (self, field.matches(',').count(), field.contains('.')) {
            (Self::Point, ..) | (_, 0, false) | (Self::Unknown, 0, true) => field.into(),
            (_, 1, false) => field.replace(',', ".").into(),
            _ => format!("{field} (a point among decimal commas)").into(),
        }
    }
}

/// A number whose thousands are apart, if it has a decimal mark besides: `1,234.5`, and `1.234,5` where commas are decimal. Alone
/// a mark may be either.
fn without_thousands(decimal: Decimal, field: &str) -> Option<String> {
    let (thousand, mark) = match decimal {
        Decimal::Point => (',', '.'),
        Decimal::Comma => ('.', ','),
        Decimal::Unknown => return None,
    };
    let (whole, part) = field.split_once(mark)?;
    let mut groups = whole.trim_start_matches(['-', '+']).split(thousand);
    let figures = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().filter(|group| group.len() <= 3 && figures(group));
    let mut count = 0;
    let are_groups = groups.all(|group| {
        count += 1;
        group.len() == 3 && figures(group)
    });
    (first.is_some() && count > 0 && are_groups && figures(part))
        .then(|| format!("{}.{part}", whole.replace(thousand, "")))
}

/// A number whose thousands are apart by apostrophes, which part nothing else: `1'000`, `1’000.5`.
fn without_apostrophes(field: &str) -> Option<String> {
    let apostrophe = field.chars().find(|letter| matches!(letter, '\'' | '\u{2019}'))?;
    let whole = field.split(['.', ',']).next()?;
    let mut groups = whole.trim_start_matches(['-', '+']).split(apostrophe);
    let figures = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let first = groups.next().filter(|group| (1..=3).contains(&group.len()) && figures(group));
    (first.is_some() && groups.all(|group| group.len() == 3 && figures(group)))
        .then(|| field.replace(apostrophe, ""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thousands_are_told_from_decimals_where_the_number_has_both() {
        for (decimal, field, plain) in [
            (Decimal::Point, "-1,234.5", "-1234.5"),
            (Decimal::Point, "1,234,567.25", "1234567.25"),
            (Decimal::Comma, "1.234,5", "1234.5"),
            (Decimal::Point, "1234.5", "1234.5"),
            (Decimal::Point, "-1'234'567.5", "-1234567.5"),
            (Decimal::Comma, "1\u{2019}234,5", "1234.5"),
            (Decimal::Unknown, "1'000", "1000"),
        ] {
            assert_eq!(decimal.plain(field), plain);
        }
        for (decimal, field) in [
            (Decimal::Point, "1,234"),
            (Decimal::Point, "12,34.5"),
            (Decimal::Comma, "1.234"),
            (Decimal::Unknown, "1.2,3"),
            (Decimal::Point, "12'34"),
            (Decimal::Point, "1'000\u{2019}000"),
            (Decimal::Point, "'1000"),
        ] {
            assert!(decimal.plain(field).parse::<f64>().is_err(), "{field}");
        }
    }
}
