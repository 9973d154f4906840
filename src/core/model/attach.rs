//! Attaches the elements of effects to the grid's nodes.

use crate::model::definition::Model;
use crate::model::effect::{self, Attachment, Element};
use crate::model::energy::NodeOwners;
use crate::model::error::ModelError;
use crate::model::grid::{Grid, Segment, Stretch};
use crate::model::node::{Loss, Lossy, Node, Overlap, Spread};
use crate::model::scene::{Scene, Spot};
use crate::rig::Place;

/// What effects attach to a grid that is cut where it is attached.
pub(crate) struct Attached {
    pub(crate) grid: Grid,
    /// Elements behind each segment, then those at the nodes of the graph.
    pub(crate) nodes: Vec<Node>,
    pub(crate) spread: Vec<Spread>,
    /// Which effect owns each part of the nodes.
    pub(crate) owners: Vec<NodeOwners>,
}

/// Puts what the effects attach at nodes and cuts segments where needed.
///
/// # Errors
/// If a value is outside its physical range.
pub(crate) fn attach(model: &Model, grid: Grid, shared: &[f64], scene: &Scene) -> Result<Attached, ModelError> {
    let graph = &model.rig.graph;
    let scenes: Vec<Scene> = model.effects.iter().map(|c| Scene { line: c.line(model.rig), ..*scene }).collect();
    let mut attached = Vec::new();
    let mut accounts = Vec::new();
    for (account, (chosen, values)) in model.chosen(shared).enumerate() {
        attached.extend(chosen.effect.attachments(values, &scenes[account])?);
        accounts.resize(attached.len(), account);
    }
    let shares_by = |by: fn(&Grid, Place) -> Vec<(usize, f64)>| -> Vec<Vec<(usize, f64)>> {
        let of = |(a, &account): (&Attachment, &usize)| match a.place {
            effect::Place::At(position_m) => {
                by(&grid, Place { line: scenes[account].line, position_m }).into_iter().filter(|w| w.1 != 0.0).collect()
            }
            effect::Place::Valve | effect::Place::Supply => Vec::new(),
        };
        attached.iter().zip(&accounts).map(of).collect()
    };
    let shares = shares_by(|grid, place| grid.around(place));
    let interpolated = shares_by(|grid, place| grid.interpolated(place));
    let cuts: Vec<usize> = shares.iter().chain(&interpolated).flatten().map(|(node, _)| *node).collect();
    let grid = grid.cut(&cuts);
    let spots = spots(model, &grid);
    let mut nodes: Vec<Node> = spots.iter().map(|_| Node::default()).collect();
    let mut owners = vec![NodeOwners::default(); nodes.len()];
    let mut spread = Vec::new();
    // The nodes behind segments, by their reaches over all lines.
    let mut reaches = Vec::new();
    grid.segments.iter().fold(0, |sum, segment| {
        reaches.push(sum + segment.reaches);
        sum + segment.reaches
    });
    let index_of = |node: usize| reaches.partition_point(|&r| r < node);
    for ((attachment, (shares, interpolated)), &account) in
        attached.iter().zip(shares.iter().zip(&interpolated)).zip(&accounts)
    {
        let end = |node: usize| vec![(grid.segments.len() + node, 1.0)];
        let held = match attachment.place {
            effect::Place::At(_) => shares.iter().map(|&(node, share)| (index_of(node), share)).collect(),
            effect::Place::Valve => end(graph.valve),
            effect::Place::Supply => end(graph.supply()),
        };
        let largest = held.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let nearest = largest.map_or(grid.segments.len() + graph.valve, |(n, _)| *n);
        match (attachment.make)(&spots[nearest]) {
            Element::Loss(_) | Element::Drop(_) => {
                for (s, share) in held {
                    let overlap = Overlap::of(shares, share);
                    // At an end it stands alone, and meets nothing that it sent out.
                    let impedance = grid.segments.get(s).map_or(1.0, |segment| segment.impedance);
                    match (attachment.make)(&Spot { share, ..spots[s] }) {
                        Element::Loss(loss) => {
                            nodes[s].losses.push(Loss::new(loss, overlap, impedance));
                            owners[s].losses.push((account, loss));
                        }
                        Element::Drop(law) => {
                            nodes[s].laws.push(Lossy::new(law, overlap, impedance));
                            // It has no coefficient by which it could share the drop with other losses at the node.
                            owners[s].losses.push((account, share));
                        }
                        Element::Shunt(_) => {}
                    }
                }
            }
            Element::Shunt(shunt) if interpolated.is_empty() => {
                nodes[nearest].shunts.push(shunt);
                owners[nearest].shunts.push(account);
            }
            Element::Shunt(shunt) => {
                let at = interpolated.iter().map(|&(node, weight)| (index_of(node), weight)).collect();
                spread.push(Spread::new(shunt, account, at, grid.segments[nearest].impedance));
            }
        }
    }
    // No elements behind the last segment of a line, which is a node of the graph, nor where a head is held.
    let mut bare: Vec<bool> = vec![false; grid.segments.len()];
    grid.lines.iter().for_each(|line| bare[line.end - 1] = true);
    bare.extend((0..graph.nodes.len()).map(|node| graph.holds_head(node)));
    for (account, (chosen, values)) in model.chosen(shared).enumerate() {
        for (n, ((node, owners), spot)) in nodes.iter_mut().zip(&mut owners).zip(&spots).enumerate() {
            if !bare[n] {
                node.shunts.extend(chosen.effect.node_shunt(values, scene, spot));
                owners.shunts.resize(node.shunts.len(), account);
            }
        }
    }
    Ok(Attached { grid, nodes, spread, owners })
}

/// What elements see of the nodes behind each segment, and of those of the graph.
fn spots(model: &Model, grid: &Grid) -> Vec<Spot> {
    let graph = &model.rig.graph;
    let half = |s: &Segment| 0.5 * s.mean(Stretch::area_m2) * s.reach_m;
    let spot = |segment: &Segment, position_m: f64, volume_m3: f64| Spot {
        share: 1.0,
        elevation_m: model.rig.elevation_m(Place { line: segment.line, position_m }),
        area_m2: segment.mean(Stretch::area_m2),
        wave_speed_m_s: segment.reach_m / ((1.0 + segment.late) * grid.dt_s),
        volume_m3,
    };
    let mut spots = Vec::new();
    for (s, segment) in grid.segments.iter().enumerate() {
        let next = grid.segments.get(s + 1).filter(|next| next.line == segment.line);
        spots.push(spot(segment, segment.end_m(), half(segment) + next.map_or(0.0, half)));
    }
    for [ends, begins] in grid.ends_at(graph) {
        let volume_m3 = ends.iter().chain(&begins).map(|&s| half(&grid.segments[s])).sum();
        let at_end = ends.first().map(|&s| (s, grid.segments[s].end_m()));
        let (s, position_m) = at_end.or(begins.first().map(|&s| (s, 0.0))).unwrap_or_default();
        spots.push(spot(&grid.segments[s], position_m, volume_m3));
    }
    spots
}
