//! A number that drives tell, with its interval.

/// A number with its 90 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// True if the drives determine it: the interval is narrow enough to be used, but for the errors of a vehicle's model
    /// that lies between. No drive makes those smaller.
    pub excited: bool,
}
