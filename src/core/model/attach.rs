//! Attaches the elements of effects to the grid's nodes.

use crate::model::definition::Model;
use crate::model::effect::{Element, Place};
use crate::model::energy::NodeOwners;
use crate::model::error::ModelError;
use crate::model::grid::{Grid, Segment, Stretch};
use crate::model::node::{Loss, Node, Overlap, SharedShunt};
use crate::model::scene::{Scene, Spot};

/// Puts what the effects attach at nodes and cuts segments where needed. Returns the grid, the joints, the node before the
/// valve, and which effect owns each part.
///
/// # Errors
/// If a value is outside its physical range.
pub(crate) fn attach(
    model: &Model,
    grid: Grid,
    shared: &[f64],
    scene: &Scene,
) -> Result<(Grid, Vec<Node>, Node, Vec<NodeOwners>), ModelError> {
    let mut attached = Vec::new();
    let mut accounts = Vec::new();
    for (account, (chosen, values)) in model.chosen(shared).enumerate() {
        attached.extend(chosen.effect.attachments(values, scene)?);
        accounts.resize(attached.len(), account);
    }
    let around = |position_m: f64| grid.around(position_m).into_iter().filter(|(_, share)| *share > 0.0);
    let cuts: Vec<usize> = attached
        .iter()
        .filter_map(|a| if let Place::At(x) = a.place { Some(around(x).map(|(node, _)| node)) } else { None })
        .flatten()
        .collect();
    let shares: Vec<Vec<(usize, f64)>> = attached
        .iter()
        .map(|a| if let Place::At(x) = a.place { around(x).collect() } else { vec![(grid.reaches(), 1.0)] })
        .collect();
    let grid = grid.cut(&cuts);
    let mut nodes: Vec<Node> = grid.segments.iter().map(|_| Node::default()).collect();
    let mut owners = vec![NodeOwners::default(); nodes.len()];
    let mut spots = Vec::new();
    let mut reach = 0;
    for (s, segment) in grid.segments.iter().enumerate() {
        reach += segment.reaches;
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
        for ((attachment, shares), &account) in attached.iter().zip(&shares).zip(&accounts) {
            for &(_, share) in shares.iter().filter(|(node, _)| *node == reach) {
                let overlap = Overlap::of(shares, share);
                match (attachment.make)(&Spot { share, ..spots[s] }) {
                    Element::Loss(loss) => {
                        nodes[s].losses.push(Loss::new(loss, overlap, segment.impedance));
                        owners[s].losses.push((account, loss));
                    }
                    Element::Shunt(shunt) => {
                        let shunt = if overlap == Overlap::default() {
                            shunt
                        } else {
                            Box::new(SharedShunt::new(shunt, overlap, segment.impedance))
                        };
                        nodes[s].shunts.push(shunt);
                        owners[s].shunts.push(account);
                    }
                }
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
    Ok((grid, nodes, at_valve, owners))
}
