//! Gauss-Legendre quadrature with five points: exact for polynomials of degree nine.

/// Nodes and weights on [-1, 1].
const RULE: [(f64, f64); 5] = [
    (0.0, 0.568_888_888_888_888_9),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// The integral of a vector-valued function.
pub(super) fn integrate<const N: usize>(from: f64, to: f64, function: impl Fn(f64) -> [f64; N]) -> [f64; N] {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let mut sums = [0.0; N];
    for (node, weight) in RULE {
        let values = function(middle + half * node);
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += half * weight * value;
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    #[test]
    fn is_exact_for_degree_nine() {
        let [integral] = super::integrate(-1.0, 3.0, |x| [x.powi(9) - 4.0 * x.powi(6)]);
        let exact = |x: f64| x.powi(10) / 10.0 - 4.0 * x.powi(7) / 7.0;
        assert!((integral - (exact(3.0) - exact(-1.0))).abs() < 1e-10);
    }
}
