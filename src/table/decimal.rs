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
        match (self, field.matches(',').count(), field.contains('.')) {
            (Self::Point, ..) | (_, 0, false) | (Self::Unknown, 0, true) => field.into(),
            (_, 1, false) => field.replace(',', ".").into(),
            _ => format!("{field} (a point among decimal commas)").into(),
        }
    }
}
