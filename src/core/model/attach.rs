//! Attaches the elements of effects to the grid's nodes.

use crate::model::definition::Model;
use crate::model::effect::{Element, Place};
use crate::model::energy::NodeOwners;
use crate::model::error::ModelError;
use crate::model::grid::{Grid, Segment, Stretch};
use crate::model::node::{Loss, Node, Overlap, Spread};
use crate::model::scene::{Scene, Spot};

/// What effects attach to a grid that is cut where it is attached.
pub(crate) struct Attached {
    pub(crate) grid: Grid,
    pub(crate) joints: Vec<Node>,
    pub(crate) spread: Vec<Spread>,
    /// The node before the valve.
    pub(crate) at_valve: Node,
    /// Which effect owns each part of the nodes.
    pub(crate) owners: Vec<NodeOwners>,
}

/// Puts what the effects attach at nodes and cuts segments where needed.
///
/// # Errors
/// If a value is outside its physical range.
pub(crate) fn attach(model: &Model, grid: Grid, shared: &[f64], scene: &Scene) -> Result<Attached, ModelError> {
    let mut attached = Vec::new();
    let mut accounts = Vec::new();
    for (account, (chosen, values)) in model.chosen(shared).enumerate() {
        attached.extend(chosen.effect.attachments(values, scene)?);
        accounts.resize(attached.len(), account);
    }
    let shares: Vec<Vec<(usize, f64)>> = attached
        .iter()
        .map(|a| match a.place {
            Place::At(x) => grid.around(x).into_iter().filter(|(_, share)| *share > 0.0).collect(),
            Place::Valve => vec![(grid.reaches(), 1.0)],
        })
        .collect();
    let interpolated: Vec<Vec<(usize, f64)>> = attached
        .iter()
        .map(|a| match a.place {
            Place::At(x) => grid.interpolated(x).into_iter().filter(|(_, weight)| *weight != 0.0).collect(),
            Place::Valve => Vec::new(),
        })
        .collect();
    let cuts: Vec<usize> = shares.iter().chain(&interpolated).flatten().map(|(node, _)| *node).collect();
    let grid = grid.cut(&cuts);
    let mut nodes: Vec<Node> = grid.segments.iter().map(|_| Node::default()).collect();
    let mut owners = vec![NodeOwners::default(); nodes.len()];
    let mut spots = Vec::new();
    for (s, segment) in grid.segments.iter().enumerate() {
        let position_m = segment.start_m + segment.reach_m * segment.reaches as f64;
        let half = |s: &Segment| 0.5 * s.mean(Stretch::area_m2) * s.reach_m;
        spots.push(Spot {
            share: 1.0,
            position_m,
            elevation_m: model.rig.elevation_m(position_m),
            area_m2: segment.mean(Stretch::area_m2),
            wave_speed_m_s: segment.reach_m / grid.dt_s,
            volume_m3: half(segment) + grid.segments.get(s + 1).map_or(0.0, half),
        });
    }
    let mut spread = Vec::new();
    // The nodes that are joints or at the valve, by their reaches from the supply.
    let mut reaches = Vec::new();
    grid.segments.iter().fold(0, |sum, segment| {
        reaches.push(sum + segment.reaches);
        sum + segment.reaches
    });
    let index_of = |node: usize| reaches.partition_point(|&r| r < node);
    for ((attachment, (shares, interpolated)), &account) in
        attached.iter().zip(shares.iter().zip(&interpolated)).zip(&accounts)
    {
        let nearest = shares.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| index_of(*node));
        let z = grid.segments[nearest].impedance;
        match (attachment.make)(&spots[nearest]) {
            Element::Loss(_) => {
                for &(node, share) in shares {
                    let s = index_of(node);
                    if let Element::Loss(loss) = (attachment.make)(&Spot { share, ..spots[s] }) {
                        nodes[s].losses.push(Loss::new(loss, Overlap::of(shares, share), grid.segments[s].impedance));
                        owners[s].losses.push((account, loss));
                    }
                }
            }
            Element::Shunt(shunt) if interpolated.is_empty() => {
                nodes[nearest].shunts.push(shunt);
                owners[nearest].shunts.push(account);
            }
            Element::Shunt(shunt) => {
                let at = interpolated.iter().map(|&(node, weight)| (index_of(node), weight)).collect();
                spread.push(Spread::new(shunt, account, at, z));
            }
        }
    }
    for (account, (chosen, values)) in model.chosen(shared).enumerate() {
        for ((node, owners), spot) in nodes.iter_mut().zip(&mut owners).zip(&spots) {
            node.shunts.extend(chosen.effect.node_shunt(values, scene, spot));
            owners.shunts.resize(node.shunts.len(), account);
        }
    }
    let at_valve = nodes.pop().unwrap_or_default();
    Ok(Attached { grid, joints: nodes, spread, at_valve, owners })
}
