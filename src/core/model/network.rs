//! The steady flow in a network: continuity at every node, and the loss of head along every link.
//!
//! Links that hang on one other link alone carry what is drawn behind them. What is left, the loops and what lies
//! between heads that are held, is solved by the global gradient algorithm (Todini & Pilati 1988, in Computer
//! Applications in Water Supply 1, 1-20; as in EPANET 2): Newton's method on flows and heads at once, of which each
//! step is one symmetric system for the heads. Losses rise with the flow, so that the flow is where a convex function,
//! the content (Collins et al. 1978, Manage. Sci. 24(7):747-760), is least among all that meet continuity: a step is as
//! long as this function falls along it.

use crate::model::error::ModelError;
use crate::model::multigrid::Multigrid;

/// Links between nodes, with the order in which they are solved.
pub(crate) struct Network {
    /// Nodes at the beginning and at the end of each link.
    pub links: Vec<(usize, usize)>,
    /// Head at each node that holds one, m.
    pub held_m: Vec<Option<f64>>,
    /// Links that carry what is drawn behind them, in an order in which that is known, each with the node behind it.
    tree: Vec<(usize, usize)>,
    /// The other links.
    core: Vec<usize>,
    /// Number of each node among those of the core that hold no head.
    number: Vec<usize>,
    /// Those nodes.
    free: Vec<usize>,
    /// The links of the core between two of them, by their index in it.
    inner: Vec<usize>,
    system: Multigrid,
}

/// What flows.
pub(crate) struct Drawn<'a> {
    /// Flow drawn from each node, m³/s.
    pub nodes_m3_s: &'a [f64],
    /// Flow drawn along each link, m³/s.
    pub links_m3_s: &'a [f64],
    /// A flow of the size that is usual in each link, m³/s.
    pub usual_m3_s: &'a [f64],
    /// Flows from which the iteration starts, m³/s.
    pub start_m3_s: &'a [f64],
}

const MOST_STEPS: usize = 200;
/// The content's slope at the end of a step that is long enough, as a share of that at its beginning; halvings until
/// one is found.
const MUCH: f64 = 0.5;
const MOST_HALVINGS: usize = 40;
/// Change of all flows as a share of them, or of a link's loss as a share of the largest, at which they are found, and
/// at which they are still taken for found. In a link that takes next to no head, rounding of the heads leaves the flow
/// open.
const FOUND: f64 = 1e-14;
const NEAR: f64 = 1e-9;
/// Least slope of a link's loss, as a share of that at its usual flow: at rest a quadratic law has none.
const LEAST_SLOPE: f64 = 1e-6;

impl Network {
    /// Prepares links between nodes, of which some hold a head, m.
    pub(crate) fn new(links: Vec<(usize, usize)>, held_m: Vec<Option<f64>>) -> Network {
        let (tree, core) = prune(&links, &held_m);
        let mut number = vec![usize::MAX; held_m.len()];
        let mut free = Vec::new();
        for node in core.iter().flat_map(|&k| [links[k].0, links[k].1]) {
            if held_m[node].is_none() && number[node] == usize::MAX {
                number[node] = free.len();
                free.push(node);
            }
        }
        let is_inner = |&i: &usize| held_m[links[core[i]].0].is_none() && held_m[links[core[i]].1].is_none();
        let inner: Vec<usize> = (0..core.len()).filter(is_inner).collect();
        let edge = |&i: &usize| (number[links[core[i]].0], number[links[core[i]].1]);
        let system = Multigrid::new(free.len(), inner.iter().map(edge).collect());
        Network { links, held_m, tree, core, number, free, inner, system }
    }

    /// Flow at the end of each link, m³/s; `loss(link, flow)` is the head that a link takes, m, and its slope.
    ///
    /// # Errors
    /// [`ModelError::NoSteadyFlow`] if the iteration does not end.
    pub(crate) fn flows(&self, by: &Drawn, loss: impl Fn(usize, f64) -> (f64, f64)) -> Result<Vec<f64>, ModelError> {
        let Network { links, held_m, tree, core, number, free, inner, system } = self;
        let mut flows = vec![f64::NAN; links.len()];
        let mut drawn = by.nodes_m3_s.to_vec();
        for &(k, node) in tree {
            let (a, b) = links[k];
            if node == b {
                flows[k] = drawn[b];
                drawn[a] += flows[k] + by.links_m3_s[k];
            } else {
                flows[k] = -drawn[a] - by.links_m3_s[k];
                drawn[b] -= flows[k];
            }
        }
        if core.is_empty() {
            return Ok(flows);
        }
        let mut q: Vec<f64> = core.iter().map(|&k| by.start_m3_s[k]).collect();
        let slopes: Vec<f64> = core.iter().map(|&k| loss(k, by.usual_m3_s[k]).1.abs()).collect();
        // Links without friction share a flow as others of little friction do.
        let little = slopes.iter().copied().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min).min(f64::MAX);
        let least: Vec<f64> = slopes.iter().map(|&s| LEAST_SLOPE * if s > 0.0 { s } else { little }).collect();
        let (mut best, mut since) = (f64::INFINITY, 0);
        // Heads are counted from one that is held, and corrected: what is solved for fades, and the rounding of it.
        let datum_m = core.iter().find_map(|&k| held_m[links[k].0].or(held_m[links[k].1])).unwrap_or(0.0);
        let mut heads = vec![0.0; free.len()];
        for step in 0..MOST_STEPS {
            let head =
                |node: usize, heads: &[f64]| held_m[node].map_or_else(|| heads[number[node]], |held| held - datum_m);
            let mut diagonal = vec![0.0; free.len()];
            let mut by_m: Vec<f64> = free.iter().map(|&node| -drawn[node]).collect();
            // Of each link: what its flow would change by at these heads, and how much more by a m between its ends.
            let mut lines = Vec::with_capacity(core.len());
            let mut largest_m: f64 = f64::MIN_POSITIVE;
            for ((&k, &q), &least) in core.iter().zip(&q).zip(&least) {
                let (a, b) = links[k];
                let (drop_m, slope) = loss(k, q);
                let p = 1.0 / slope.max(least);
                let here = p * (head(a, &heads) - head(b, &heads) - drop_m);
                for (node, into) in [(a, -(q + here + by.links_m3_s[k])), (b, q + here)] {
                    if held_m[node].is_none() {
                        diagonal[number[node]] += p;
                        by_m[number[node]] += into;
                    }
                }
                lines.push((here, p));
                largest_m = largest_m.max(drop_m.abs());
            }
            let weights: Vec<f64> = inner.iter().map(|&i| lines[i].1).collect();
            system.solve(&diagonal, &weights, &mut by_m);
            heads.iter_mut().zip(&by_m).for_each(|(head, by)| *head += by);
            // Of each link, how much its flow changes and the head between its ends.
            let mut steps = Vec::with_capacity(core.len());
            let (mut moved, mut whole) = (0.0, f64::MIN_POSITIVE);
            let mut off_m: f64 = 0.0;
            for ((&k, q), (here, p)) in core.iter().zip(&q).zip(lines) {
                let (a, b) = links[k];
                let by_m = |node: usize| if held_m[node].is_none() { by_m[number[node]] } else { 0.0 };
                let by = here + p * (by_m(a) - by_m(b));
                moved += by.abs();
                whole += (*q + by).abs();
                off_m = off_m.max((by / p).abs());
                steps.push((by, head(a, &heads) - head(b, &heads)));
            }
            let change = (moved / whole).min(off_m / largest_m);
            if !moved.is_finite() {
                return Err(ModelError::NoSteadyFlow);
            }
            // The first flows do not meet continuity: a whole step makes them do so.
            let part = if step == 0 { 1.0 } else { part(core, &q, &steps, &loss) };
            let steps = steps.into_iter().map(|(by, _)| by);
            q.iter_mut().zip(steps).for_each(|(q, step)| *q += part * step);
            (best, since) = if change < best { (change, 0) } else { (best, since + 1) };
            // Rounding ends the iteration where the smallest change does not.
            if change <= FOUND || (best <= NEAR && since >= 3) {
                break;
            }
        }
        if best > NEAR {
            return Err(ModelError::NoSteadyFlow);
        }
        core.iter().zip(q).for_each(|(&k, q)| flows[k] = q);
        Ok(flows)
    }
}

/// How much of a step to take, at most all of it: the content falls along it by `Σ by (loss - head between)`, which
/// rises on the way.
fn part(core: &[usize], q: &[f64], steps: &[(f64, f64)], loss: &impl Fn(usize, f64) -> (f64, f64)) -> f64 {
    let slope = |part: f64| {
        let links = core.iter().zip(q).zip(steps);
        links.map(|((&k, q), &(by, between_m))| by * (loss(k, q + part * by).0 - between_m)).sum::<f64>()
    };
    let first = slope(0.0).abs();
    let (mut low, mut high) = (0.0, 1.0);
    if slope(high) <= MUCH * first {
        return high;
    }
    for _ in 0..MOST_HALVINGS {
        let middle = 0.5 * (low + high);
        match slope(middle) {
            found if found.abs() <= MUCH * first => return middle,
            found if found > 0.0 => high = middle,
            _ => low = middle,
        }
    }
    high
}

/// The links at the end of which nothing but what is drawn there leaves, over and over, each with that end; and the
/// rest.
fn prune(links: &[(usize, usize)], held_m: &[Option<f64>]) -> (Vec<(usize, usize)>, Vec<usize>) {
    let mut at_node = vec![Vec::new(); held_m.len()];
    for (k, &(a, b)) in links.iter().enumerate() {
        at_node[a].push(k);
        at_node[b].push(k);
    }
    let mut degree: Vec<usize> = at_node.iter().map(Vec::len).collect();
    // With a single head that is held, nothing depends on it, and its links are pruned from the other side alone.
    let mut open: Vec<usize> = (0..degree.len()).filter(|&node| degree[node] == 1 && held_m[node].is_none()).collect();
    let (mut tree, mut gone) = (Vec::new(), vec![false; links.len()]);
    while let Some(node) = open.pop() {
        let Some(&k) = at_node[node].iter().find(|&&k| !gone[k]) else { continue };
        let other = links[k].0 + links[k].1 - node;
        tree.push((k, node));
        gone[k] = true;
        degree[other] -= 1;
        if degree[other] == 1 && held_m[other].is_none() {
            open.push(other);
        }
    }
    (tree, (0..links.len()).filter(|&k| !gone[k]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pipes side by side share a flow as the roots of their losses do; a tree behind them carries what is drawn.
    #[test]
    fn a_loop_shares_its_flow_and_a_tree_carries_what_is_drawn() {
        let links = [(0, 1), (0, 1), (1, 2), (3, 1)];
        let network = Network::new(links.to_vec(), vec![Some(50.0), None, None, None]);
        let (nodes_m3_s, links_m3_s) = (&[0.0, 0.1, 0.5, 0.2], &[0.0, 0.0, 0.01, 0.0]);
        let drawn = Drawn { nodes_m3_s, links_m3_s, usual_m3_s: &[0.3; 4], start_m3_s: &[0.3; 4] };
        let r = [1.0, 4.0, 1.0, 1.0];
        let flows = network.flows(&drawn, |k, q| (r[k] * q * q.abs(), 2.0 * r[k] * q.abs())).unwrap();
        assert_eq!(flows[2..], [0.5, -0.2]);
        assert!((flows[0] + flows[1] - 0.81).abs() < 1e-14 && (flows[0] / flows[1] - 2.0).abs() < 1e-12, "{flows:?}");
    }

    /// Three reservoirs: the textbook's branching pipes, by the head at their junction.
    #[test]
    fn three_reservoirs_meet_at_the_junction_of_zero_sum() {
        let held = [Some(120.0), Some(100.0), Some(80.0), None];
        let network = Network::new(vec![(0, 3), (1, 3), (2, 3)], held.to_vec());
        let drawn =
            Drawn { nodes_m3_s: &[0.0; 4], links_m3_s: &[0.0; 3], usual_m3_s: &[0.1; 3], start_m3_s: &[0.1; 3] };
        let r = [160.0, 400.0, 900.0];
        let flows = network.flows(&drawn, |k, q| (r[k] * q * q.abs(), 2.0 * r[k] * q.abs())).unwrap();
        let into = |head: f64| {
            let of = |k: usize| held[k].map_or(0.0, |h: f64| (h - head).signum() * ((h - head).abs() / r[k]).sqrt());
            of(0) + of(1) + of(2)
        };
        let (mut low, mut high) = (80.0, 120.0);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if into(middle) > 0.0 { low = middle } else { high = middle }
        }
        assert!(flows.iter().sum::<f64>().abs() < 1e-13, "{flows:?}");
        for k in 0..3 {
            let head = held[k].unwrap() - r[k] * flows[k] * flows[k].abs();
            assert!((head - low).abs() < 1e-9, "{head} {low}");
        }
    }

    /// EPANET's example network 1 at time 0, with its own law of loss (Hazen & Williams, ft and ft³/s) and pump curve:
    /// flows of EPANET 2.2 at an accuracy of 1e-8, in US gallons a minute.
    #[test]
    fn epanets_first_example_is_met() {
        // As EPANET rounds it.
        const GPM: f64 = 1.0 / 448.831;
        // from, to, length ft, diameter in, flow gpm; the last is the pump
        let links = [
            (0, 1, 10530.0, 18.0, 1866.1758299942014),
            (1, 2, 5280.0, 14.0, 1234.2071803141478),
            (2, 3, 5280.0, 10.0, 129.3351345904398),
            (4, 5, 5280.0, 10.0, 191.15813055369506),
            (5, 6, 5280.0, 12.0, 120.66486540959117),
            (7, 8, 5280.0, 6.0, 40.81051912634951),
            (10, 2, 200.0, 18.0, -766.175829993151),
            (1, 4, 5280.0, 10.0, 481.9686496800506),
            (2, 5, 5280.0, 12.0, 188.6962157295357),
            (3, 6, 5280.0, 8.0, 29.335134590460527),
            (4, 7, 5280.0, 8.0, 140.81051912634896),
            (5, 8, 5280.0, 6.0, 59.18948087364991),
            (9, 0, 0.0, 0.0, 1866.1758299942014),
        ];
        let mut held = [None; 11];
        (held[9], held[10]) = (Some(800.0), Some(970.0));
        let drawn = [0.0, 150.0, 150.0, 100.0, 150.0, 200.0, 150.0, 100.0, 100.0, 0.0, 0.0].map(|q: f64| q * GPM);
        let ends: Vec<(usize, usize)> = links.iter().map(|l| (l.0, l.1)).collect();
        let network = Network::new(ends, held.to_vec());
        let drawn =
            Drawn { nodes_m3_s: &drawn, links_m3_s: &[0.0; 13], usual_m3_s: &[1.0; 13], start_m3_s: &[1.0; 13] };
        let flows = network.flows(&drawn, |k, q| {
            let (_, _, length, inches, _) = links[k];
            if length == 0.0 {
                // One point of 1500 gpm and 250 ft; EPANET's shutoff head is 1.33334 of its head, and no head is left
                // at twice its flow.
                let rated = 1500.0 * GPM;
                let power = (1.33334f64 / 0.33334).log2();
                let fall = 0.33334 * 250.0 * (q.abs() / rated).powf(power);
                return (fall - 1.33334 * 250.0, power * fall / q.abs());
            }
            let r = 4.727 * 100f64.powf(-1.852) * (inches / 12.0f64).powf(-4.871) * length;
            (r * q * q.abs().powf(0.852), 1.852 * r * q.abs().powf(0.852))
        });
        for (link, q) in links.iter().zip(flows.unwrap()) {
            assert!((q / GPM / link.4 - 1.0).abs() < 1e-6, "{} to {}: {} for {}", link.0, link.1, q / GPM, link.4);
        }
    }
}
