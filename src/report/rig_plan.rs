//! Where the parts of a rig are drawn: at the places that the file gives its nodes, or else the way from the supply to
//! the valve as a straight line, with what branches off it in rows above and below.

use crate::extent::ends;
use crate::rig::{Graph, Place, Rig};

/// Distance between rows, as a share of the drawing's width.
const ROW: f64 = 0.08;
/// Along the way, as a share of its length: how soon a branch reaches its row, and what stays free behind it.
const BEND: f64 = 0.03;
const FREE: f64 = 0.1;
/// Greatest height of a drawing by the file's places, as a share of its width.
const HIGHEST: f64 = 0.5;

/// A point: shares of the drawing's width to the right, from its left edge, and down.
pub type Point = [f64; 2];

/// See the module.
pub struct Plan {
    /// Where each node is.
    pub nodes: Vec<Point>,
    /// The corners of each line, from its beginning to its end.
    pub lines: Vec<Vec<Point>>,
}

impl Plan {
    /// Of a rig.
    pub fn of(rig: &Rig) -> Plan {
        let graph = &rig.graph;
        let given: Option<Vec<Point>> = graph.nodes.iter().map(|node| node.at).collect();
        let to_scale = given.is_some();
        let mut plan = given.map_or_else(|| Rows::of(rig).plan, |at| by_places(graph, &at));
        let points = || plan.nodes.iter().chain(plan.lines.iter().flatten());
        let (least, most) = ends(points().map(|p| p[0]));
        let wide = (most - least).max(f64::MIN_POSITIVE);
        let high = points().fold(0.0, |high: f64, p| high.max(p[1].abs()));
        // Places keep their shape, within the height; rows keep their distance.
        let both = (1.0 / wide).min(HIGHEST / high.max(f64::MIN_POSITIVE));
        let [along, down] = if to_scale { [both, both] } else { [1.0 / wide, ROW] };
        let scale = |p: &mut Point| *p = [(p[0] - least) * along, p[1] * down];
        plan.nodes.iter_mut().chain(plan.lines.iter_mut().flatten()).for_each(scale);
        plan
    }

    /// Where a place on a line is.
    pub fn at(&self, rig: &Rig, place: Place) -> Point {
        along(&self.lines[place.line], place.position_m / rig.line_length_m(place.line))
    }

    /// The direction away from the pipes at a node where one line ends; none where several meet.
    pub fn outward(&self, graph: &Graph, node: usize) -> Option<Point> {
        let mut own = graph.lines.iter().zip(&self.lines).filter(|(line, _)| line.from == node || line.to == node);
        let (line, corners) = own.next().filter(|_| own.next().is_none())?;
        let (end, before) = match corners[..] {
            [first, second, ..] if line.from == node => (first, second),
            [.., before, last] => (last, before),
            _ => return None,
        };
        let (dx, dy) = (end[0] - before[0], end[1] - before[1]);
        let length = dx.hypot(dy);
        (length > 0.0).then(|| [dx / length, dy / length])
    }

    /// The highest and the lowest point, down.
    pub fn heights(&self) -> Point {
        let all = self.nodes.iter().chain(self.lines.iter().flatten());
        all.fold([0.0, 0.0], |[high, low]: Point, p| [high.min(p[1]), low.max(p[1])])
    }
}

/// The point at a share of a line's drawn length.
fn along(corners: &[Point], share: f64) -> Point {
    let length = |w: &[Point]| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]);
    let whole: f64 = corners.windows(2).map(length).sum();
    let mut left = share.clamp(0.0, 1.0) * whole;
    for w in corners.windows(2) {
        let own = length(w);
        if left <= own && own > 0.0 {
            return [0, 1].map(|i| w[0][i] + (w[1][i] - w[0][i]) * left / own);
        }
        left -= own;
    }
    corners.last().copied().unwrap_or_default()
}

/// Nodes where the file has them. Lines between the same nodes stand apart.
fn by_places(graph: &Graph, at: &[Point]) -> Plan {
    let nodes: Vec<Point> = at.iter().map(|[right, up]| [*right, at[graph.supply()][1] - up]).collect();
    let mut lines: Vec<Vec<Point>> = Vec::new();
    for (k, line) in graph.lines.iter().enumerate() {
        let (a, b) = (nodes[line.from], nodes[line.to]);
        let same = |other: &&crate::rig::Line| {
            [other.from, other.to] == [line.from, line.to] || [other.from, other.to] == [line.to, line.from]
        };
        let before = graph.lines[..k].iter().filter(same).count() as f64;
        let mut corners = vec![a, b];
        if before > 0.0 {
            let middle = [0, 1].map(|i| 0.5 * (a[i] + b[i]));
            corners.insert(1, [middle[0] - 0.2 * before * (b[1] - a[1]), middle[1] + 0.2 * before * (b[0] - a[0])]);
        }
        lines.push(corners);
    }
    Plan { nodes, lines }
}

/// A plan in rows, numbered downwards from the way's: m along the way, and rows.
struct Rows<'a> {
    graph: &'a Graph,
    way_m: f64,
    plan: Plan,
    /// The stretches that are taken, each with its row.
    taken: Vec<(i32, Point)>,
}

impl<'a> Rows<'a> {
    fn of(rig: &'a Rig) -> Rows<'a> {
        let graph = &rig.graph;
        let lengths_m: Vec<f64> = (0..graph.lines.len()).map(|line| rig.line_length_m(line)).collect();
        let (nodes, lines) = (vec![[f64::NAN; 2]; graph.nodes.len()], vec![Vec::new(); lengths_m.len()]);
        let mut rows = Rows { graph, way_m: rig.length_m(), plan: Plan { nodes, lines }, taken: Vec::new() };
        let mut open = std::collections::VecDeque::from([graph.supply()]);
        let mut x = 0.0;
        rows.plan.nodes[graph.supply()] = [0.0, 0.0];
        for &(k, backwards) in &graph.way {
            let line = &graph.lines[k];
            x += lengths_m[k];
            let end = if backwards { line.from } else { line.to };
            rows.plan.nodes[end] = [x, 0.0];
            rows.plan.lines[k] = vec![rows.plan.nodes[line.from], rows.plan.nodes[line.to]];
            open.push_back(end);
        }
        rows.taken.push((0, [0.0, x]));
        let at_nodes = graph.lines_at_nodes();
        while let Some(n) = open.pop_front() {
            for &k in &at_nodes[n] {
                let other = graph.lines[k].from + graph.lines[k].to - n;
                if rows.plan.nodes[other][0].is_nan() {
                    let from_m = rows.plan.nodes[n][0];
                    let row = rows.free(rows.plan.nodes[n][1], [from_m, from_m + lengths_m[k]]);
                    rows.plan.nodes[other] = [from_m + lengths_m[k], f64::from(row)];
                    open.push_back(other);
                    rows.lay(k, n, other, row);
                }
            }
        }
        // Lines that close loops have rows of their own.
        for k in 0..lengths_m.len() {
            if rows.plan.lines[k].is_empty() {
                let (a, b) = (graph.lines[k].from, graph.lines[k].to);
                let [x, y] = [rows.plan.nodes[a][0], rows.plan.nodes[b][0]];
                let row = rows.free(f64::NAN, [x.min(y), x.max(y)]);
                rows.lay(k, a, b, row);
            }
        }
        rows
    }

    /// The first row in which a stretch is free: its own, if there is one that it goes on in, then those next to the
    /// way.
    fn free(&mut self, own: f64, [from_m, to_m]: Point) -> i32 {
        let free = |row: &i32, beside_m: f64| {
            let mut in_row = self.taken.iter().filter(|(taken, _)| taken == row);
            in_row.all(|(_, [a, b])| to_m + beside_m <= *a || from_m >= *b + beside_m)
        };
        let own = (own != 0.0 && own.is_finite()).then_some(own as i32).filter(|row| free(row, 0.0));
        let mut others = (1..).flat_map(|row| [row, -row]).filter(|row| free(row, FREE * self.way_m));
        let row = own.or(others.next()).unwrap_or(1);
        self.taken.push((row, [from_m, to_m]));
        row
    }

    /// A line from `a` to `b` in a row.
    fn lay(&mut self, k: usize, a: usize, b: usize, row: i32) {
        let (from, to, row) = (self.plan.nodes[a], self.plan.nodes[b], f64::from(row));
        let bend = BEND * self.way_m * (to[0] - from[0]).signum();
        let mut corners = vec![from];
        if (to[0] - from[0]).abs() > 2.0 * bend.abs() {
            corners.extend((from[1] != row).then_some([from[0] + bend, row]));
            corners.extend((to[1] != row).then_some([to[0] - bend, row]));
        } else if from[1] != row && to[1] != row {
            corners.push([0.5 * (from[0] + to[0]), row]);
        }
        corners.push(to);
        if self.graph.lines[k].from != a {
            corners.reverse();
        }
        self.plan.lines[k] = corners;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn branched(places: bool) -> Rig {
        let text = include_str!("../../rigs/branched.toml");
        let kept = |line: &&str| places || !line.starts_with("at = ");
        Rig::from_toml(&text.lines().filter(kept).collect::<Vec<_>>().join("\n"), "rig.toml").unwrap()
    }

    fn near(a: Point, b: Point) {
        assert!((a[0] - b[0]).abs() < 1e-12 && (a[1] - b[1]).abs() < 1e-12, "{a:?} {b:?}");
    }

    #[test]
    fn the_way_is_a_straight_line_and_a_branch_has_a_row() {
        let rig = branched(false);
        let plan = Plan::of(&rig);
        near(plan.at(&rig, Place { line: 0, position_m: 150.0 }), [150.0 / 420.0, 0.0]);
        near(plan.at(&rig, Place { line: 1, position_m: 60.0 }), [360.0 / 420.0, 0.0]);
        near(plan.at(&rig, Place { line: 2, position_m: 0.0 }), [300.0 / 420.0, 0.0]);
        near(plan.at(&rig, Place { line: 2, position_m: 83.0 }), [383.0 / 420.0, ROW]);
        assert_eq!(plan.outward(&rig.graph, rig.graph.supply()), Some([-1.0, 0.0]));
        assert_eq!(plan.outward(&rig.graph, 1), None);
    }

    #[test]
    fn places_of_the_file_are_kept_to_scale() {
        let rig = branched(true);
        let plan = Plan::of(&rig);
        near(plan.at(&rig, Place { line: 2, position_m: 83.0 }), [300.0 / 420.0, -80.0 / 420.0]);
        near(plan.at(&rig, rig.valve_place()), [1.0, 0.0]);
    }
}
