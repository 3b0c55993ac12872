//! The nodes of a glTF file: where each mesh is drawn, with its instances and its skin.

use super::{GltfWrong, Soup, document::Document, json, lacks};
use crate::{source::Source, within as of};
use glam::{DMat4, DQuat, DVec3};

/// The most visits of nodes beyond the first of each: a file may draw a node for several parents, but not without end.
const MOST_VISITS: usize = 1 << 20;

/// Where the vertices of a mesh are drawn.
pub(super) enum Placed {
    /// As they are in the file.
    Here,
    At(DMat4),
    /// By the joints of a skin: what each makes of a vertex.
    Skin(Vec<DMat4>),
}

/// A transform; `None` where it does nothing.
fn trs(translation: Option<[f64; 3]>, rotation: Option<[f64; 4]>, scale: Option<[f64; 3]>) -> Option<DMat4> {
    let scale = scale.map_or(DVec3::ONE, DVec3::from);
    let rotation = rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    // A quaternion of no length turns nothing.
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    let translation = translation.map_or(DVec3::ZERO, DVec3::from);
    Some(DMat4::from_scale_rotation_translation(scale, rotation, translation)).filter(|place| *place != DMat4::IDENTITY)
}

/// The transform of a node within its parent.
fn local(node: &json::Node) -> Option<DMat4> {
    match node.matrix {
        Some(matrix) => Some(DMat4::from_cols_array(&matrix)).filter(|matrix| *matrix != DMat4::IDENTITY),
        None => trs(node.translation, node.rotation, node.scale),
    }
}

fn within(parent: Option<DMat4>, local: Option<DMat4>) -> Option<DMat4> {
    match (parent, local) {
        (Some(parent), Some(local)) => Some(parent * local),
        (parent, local) => parent.or(local),
    }
}

/// The nodes that the scene begins with; if the file has no scene, all that are no children.
fn roots(root: &json::Root) -> Vec<usize> {
    match root.scenes.get(root.scene.map_or(0, |scene| scene.0)) {
        Some(scene) => scene.nodes.iter().map(|node| node.0).collect(),
        None => {
            let children = root.nodes.iter().flat_map(|node| &node.children);
            let children: std::collections::HashSet<usize> = children.map(|node| node.0).collect();
            (0..root.nodes.len()).filter(|node| !children.contains(node)).collect()
        }
    }
}

/// Visits all nodes that are drawn, from the first to the last, with their places. A node of several parents is visited for each. A
/// node below itself is left out with a note.
fn visit<'a>(
    source: &mut Source,
    root: &'a json::Root,
    mut take: impl FnMut(&mut Source, usize, &'a json::Node, Option<DMat4>) -> Result<(), GltfWrong>,
) -> Result<(), GltfWrong> {
    // A node to enter with its parent's place, or one to leave.
    enum Step {
        Enter(usize, Option<DMat4>),
        Leave(usize),
    }
    let mut waiting: Vec<Step> = roots(root).into_iter().rev().map(|node| Step::Enter(node, None)).collect();
    let mut is_above = vec![false; root.nodes.len()];
    let mut visits = 0;
    while let Some(step) = waiting.pop() {
        let (index, parent) = match step {
            Step::Enter(index, parent) => (index, parent),
            Step::Leave(index) => {
                is_above[index] = false;
                continue;
            }
        };
        let node = root.nodes.get(index).ok_or_else(|| lacks("node", index, root.nodes.len()))?;
        visits += 1;
        if visits > MOST_VISITS + root.nodes.len() {
            return Err(("its nodes have too many parents in all".into(), "give each node one parent".into()));
        }
        if std::mem::replace(&mut is_above[index], true) {
            source.notes.count(None, "a node that is its own descendant is drawn once");
            continue;
        }
        waiting.push(Step::Leave(index));
        let hidden = node.extensions.get("KHR_node_visibility").is_some_and(|value| value["visible"] == false);
        if hidden {
            continue;
        }
        let place = within(parent, local(node));
        take(source, index, node, place)?;
        waiting.extend(node.children.iter().rev().map(|child| Step::Enter(child.0, place)));
    }
    Ok(())
}

/// Adds the meshes of all nodes of the scene.
pub(super) fn add_scene(soup: &mut Soup, source: &mut Source, document: &mut Document) -> Result<(), GltfWrong> {
    let root = document.root;
    let mut worlds = vec![None; if root.skins.is_empty() { 0 } else { root.nodes.len() }];
    visit(source, root, |_, index, _, place| {
        worlds.iter_mut().skip(index).take(1).for_each(|world| *world = place);
        Ok(())
    })?;
    visit(source, root, |source, _, node, place| {
        let Some(mesh) = node.mesh else { return Ok(()) };
        let drawn = root.meshes.get(mesh.0).ok_or_else(|| lacks("mesh", mesh.0, root.meshes.len()))?;
        let weights = if node.weights.is_empty() { &drawn.weights } else { &node.weights };
        for placed in places(source, document, node, place, &worlds)? {
            for (number, primitive) in drawn.primitives.iter().enumerate() {
                let at = of(format!("mesh {}, primitive {number}", mesh.0));
                soup.add(source, document, primitive, weights, &placed).map_err(at)?;
            }
        }
        Ok(())
    })
}

/// The places at which a node draws its mesh.
fn places(
    source: &mut Source,
    document: &mut Document,
    node: &json::Node,
    place: Option<DMat4>,
    worlds: &[Option<DMat4>],
) -> Result<Vec<Placed>, GltfWrong> {
    let at = |place: Option<DMat4>| place.map_or(Placed::Here, Placed::At);
    if let Some(skin) = node.skin.and_then(|skin| document.root.skins.get(skin.0)) {
        let inverses = match skin.inverse_bind_matrices {
            Some(inverses) => document.vectors::<16>(source, inverses.0)?,
            None => Vec::new(),
        };
        let joint = |(i, joint): (usize, &json::Whole)| {
            let world = worlds.get(joint.0).copied().flatten().unwrap_or(DMat4::IDENTITY);
            let inverse = inverses.get(i).map_or(DMat4::IDENTITY, |m| DMat4::from_cols_array(&m.map(f64::from)));
            world * inverse
        };
        return Ok(vec![Placed::Skin(skin.joints.iter().enumerate().map(joint).collect())]);
    }
    let Some(instances) = node.extensions.get("EXT_mesh_gpu_instancing") else { return Ok(vec![at(place)]) };
    let index = |name: &str| instances["attributes"][name].as_u64().map(|index| index as usize);
    let [translation, rotation, scale] = ["TRANSLATION", "ROTATION", "SCALE"].map(index);
    let translation = translation.map(|index| document.vectors::<3>(source, index)).transpose()?;
    let rotation = rotation.map(|index| document.vectors::<4>(source, index)).transpose()?;
    let scale = scale.map(|index| document.vectors::<3>(source, index)).transpose()?;
    let count = [translation.as_ref().map(Vec::len), rotation.as_ref().map(Vec::len), scale.as_ref().map(Vec::len)];
    let count = count.into_iter().flatten().min().unwrap_or(0);
    let one = |i: usize| {
        let three = |all: &Option<Vec<[f32; 3]>>| all.as_ref().map(|all| all[i].map(f64::from));
        let turn = rotation.as_ref().map(|all| all[i].map(f64::from));
        at(within(place, trs(three(&translation), turn, three(&scale))))
    };
    Ok((0..count).map(one).collect())
}

impl Placed {
    /// The transforms of a primitive's vertices: none, one for all, or one for each.
    pub fn of_vertices(
        &self,
        source: &mut Source,
        document: &mut Document,
        primitive: &json::Primitive,
        count: usize,
    ) -> Result<Vec<DMat4>, GltfWrong> {
        let matrices = match self {
            Self::Here => return Ok(Vec::new()),
            Self::At(place) => return Ok(vec![*place]),
            Self::Skin(matrices) => matrices,
        };
        let mut places = vec![DMat4::ZERO; count];
        let mut total = vec![0.0; count];
        for set in 0.. {
            let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let [Some(joints), Some(weights)] = names.map(|name| primitive.attribute(&name)) else { break };
            let (joints, weights) = (document.joints(source, joints)?, document.vectors::<4>(source, weights)?);
            for (i, (joints, weights)) in joints.into_iter().zip(weights).take(count).enumerate() {
                for (joint, weight) in
                    joints.into_iter().zip(weights.map(f64::from)).filter(|(_, weight)| *weight != 0.0)
                {
                    let matrix = matrices.get(joint as usize);
                    let matrix = matrix.ok_or_else(|| lacks("joint", joint as usize, matrices.len()))?;
                    places[i] += *matrix * weight;
                    total[i] += weight;
                }
            }
        }
        let whole = |(place, total): (DMat4, f64)| if total > 0.0 { place * (1.0 / total) } else { DMat4::IDENTITY };
        Ok(places.into_iter().zip(total).map(whole).collect())
    }
}
