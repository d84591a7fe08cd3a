//! Arc length: a curve cut into equal steps of arc length, so that a lookup is one division and a polynomial.
//!
//! Between two neighbouring nodes the yaw angle is the cubic, and each coordinate the quintic, that match the
//! curve's value and derivatives at both. So `curvature = d yaw / ds` exactly, it is continuous, and `|r'| = 1` to
//! the order of `(step / radius)^6`.

use super::spline::{Quintic, QuinticSpline, arc_length, evaluate, quintic, speed};

/// Longest step between nodes in m.
const STEP: f64 = 0.25;
/// Most cells of a path, whatever its length.
const MOST_CELLS: f64 = 2e6;

/// One step of arc length: polynomials in the arc length since the cell's start.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    pub yaw: [f64; 4],
    pub x: Quintic,
    pub y: Quintic,
}

/// The cells of a path and where they came from.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub step: f64,
    pub length: f64,
    pub cells: Vec<Cell>,
    /// Arc length at the points that the curve was made from.
    pub mark_stations: Vec<f64>,
}

/// Position, heading and curvature at a node.
#[derive(Debug, Clone, Copy)]
struct Node {
    p: [f64; 2],
    yaw: f64,
    curvature: f64,
}

impl Grid {
    /// Cuts a curve into equal steps.
    pub fn new(curve: &QuinticSpline) -> Self {
        let knot_stations = curve.knot_stations();
        let length = knot_stations[curve.pieces()];
        let count = (length / STEP).ceil().clamp(1.0, MOST_CELLS) as usize;
        let step = length / count as f64;

        let mut nodes: Vec<Node> = Vec::with_capacity(count + 1);
        let mut piece_index = 0;
        let mut piece = curve.piece(0);
        // Where the search stands in the piece: parameter and its station.
        let (mut u, mut station) = (0.0, 0.0);
        for index in 0..=count {
            let target = if index == count { length } else { index as f64 * step };
            while piece_index + 1 < curve.pieces() && target > knot_stations[piece_index + 1] {
                piece_index += 1;
                piece = curve.piece(piece_index);
                (u, station) = (0.0, knot_stations[piece_index]);
            }
            let span = curve.knots[piece_index + 1].t - curve.knots[piece_index].t;
            let near_end = knot_stations[piece_index + 1] - target < 1e-12 * length.max(1.0);
            if near_end {
                (u, station) = (span, knot_stations[piece_index + 1]);
            } else {
                // Newton on arc length, in short hops so that the quadrature stays exact.
                for _ in 0..24 {
                    let missing = target - station;
                    if missing.abs() < 1e-13 * length.max(1.0) {
                        break;
                    }
                    let hop = (missing / speed(&piece, u).max(1e-3)).clamp(-1.0, 1.0);
                    let next = (u + hop).clamp(0.0, span);
                    station += arc_length(&piece, u, next);
                    u = next;
                }
            }
            let mut node = node(&piece, u, nodes.last());
            if let Some(yaw) = &curve.yaw {
                let from = knot_stations[piece_index];
                let cubic =
                    yaw_cubic(yaw[piece_index], yaw[piece_index + 1], knot_stations[piece_index + 1] - from);
                [node.yaw, node.curvature, _] = yaw_at(&cubic, target - from);
            }
            nodes.push(node);
        }
        let cells = nodes.windows(2).map(|pair| cell(&pair[0], &pair[1], step)).collect();
        Self { step, length, cells, mark_stations: curve.mark_stations() }
    }
}

/// Position, unwrapped yaw and curvature of a piece at `u`.
fn node(piece: &[Quintic; 2], u: f64, previous: Option<&Node>) -> Node {
    let [x, dx, ddx] = evaluate(&piece[0], u);
    let [y, dy, ddy] = evaluate(&piece[1], u);
    let raw = dy.atan2(dx);
    let yaw = previous.map_or(raw, |last| last.yaw + super::wrap_angle(raw - last.yaw));
    let speed = dx.hypot(dy).max(1e-9);
    Node { p: [x, y], yaw, curvature: (dx * ddy - dy * ddx) / (speed * speed * speed) }
}

/// The cubic with given yaw and curvature at 0 and at `h`, rising powers.
fn yaw_cubic(a: [f64; 2], b: [f64; 2], h: f64) -> [f64; 4] {
    let turn = b[0] - a[0];
    [a[0], a[1], (3.0 * turn / h - 2.0 * a[1] - b[1]) / h, (a[1] + b[1] - 2.0 * turn / h) / (h * h)]
}

/// Yaw, curvature and its rate.
#[inline]
pub(super) fn yaw_at(c: &[f64; 4], u: f64) -> [f64; 3] {
    [
        c[0] + u * (c[1] + u * (c[2] + u * c[3])),
        c[1] + u * (2.0 * c[2] + u * 3.0 * c[3]),
        2.0 * c[2] + 6.0 * c[3] * u,
    ]
}

/// The polynomials between two nodes.
fn cell(a: &Node, b: &Node, h: f64) -> Cell {
    let ((sin_a, cos_a), (sin_b, cos_b)) = (a.yaw.sin_cos(), b.yaw.sin_cos());
    Cell {
        yaw: yaw_cubic([a.yaw, a.curvature], [b.yaw, b.curvature], h),
        x: quintic([a.p[0], cos_a, -a.curvature * sin_a], [b.p[0], cos_b, -b.curvature * sin_b], h),
        y: quintic([a.p[1], sin_a, a.curvature * cos_a], [b.p[1], sin_b, b.curvature * cos_b], h),
    }
}
