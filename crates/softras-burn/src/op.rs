//! The renderer as an operation of burn's graph: an image tensor whose backward step runs the renderer's backward pass.

use crate::rendered::{Rendered, Role};
use burn::backend::autodiff::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::ops::FloatTensorOps;
use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::{Tensor, TensorData};
use std::sync::Arc;

/// A rendered frame, shared with the backward step.
#[derive(Clone, Debug)]
pub struct Node(Arc<Rendered>);

/// The images of a frame as a function of its inputs.
#[backend_extension(Flex, Autodiff)]
pub trait RenderOps: Backend {
    /// The packed images `[views, height, width, channels]` of a frame that has been rendered from these inputs; for an input
    /// that was taken from the scene, pass any tensor that is not tracked.
    fn softras_images(
        positions: FloatTensor<Self>,
        colors: FloatTensor<Self>,
        texels: FloatTensor<Self>,
        cameras: FloatTensor<Self>,
        node: Node,
    ) -> FloatTensor<Self>;
}

impl RenderOps for Flex {
    fn softras_images(
        positions: FloatTensor<Self>,
        _: FloatTensor<Self>,
        _: FloatTensor<Self>,
        _: FloatTensor<Self>,
        node: Node,
    ) -> FloatTensor<Self> {
        let (data, shape) = node.0.images();
        Self::float_from_data(TensorData::new(data, shape), &positions.device())
    }
}

/// The backward step.
#[derive(Debug)]
struct RenderNode;

impl<B: RenderOps> Backward<B, 4> for RenderNode {
    type State = Node;

    fn backward(self, ops: Ops<Node, 4>, gradients: &mut Gradients, _: &mut Checkpointer) {
        let upstream = gradients.consume::<B>(&ops.node);
        let device = upstream.device();
        let wanted = [0, 1, 2, 3].map(|i| ops.parents[i].is_some());
        let pulled = ops.state.0.pull_back(host::<B>(upstream), wanted);
        for ((parent, data), role) in ops.parents.into_iter().zip(pulled).zip(Role::ALL) {
            let Some(parent) = parent else { continue };
            let shape = [data.len() / role.columns(), role.columns()];
            gradients.register::<B>(parent.id, B::float_from_data(TensorData::new(data, shape), &device));
        }
    }
}

/// The values of a tensor; `None` where the backend cannot give them.
fn host<B: Backend>(tensor: FloatTensor<B>) -> Option<Vec<f32>> {
    let data = burn::tensor::try_read_sync(B::float_into_data(tensor))?.ok()?;
    data.try_cast_as::<f32>().ok()?.try_into_vec().ok()
}

impl<B: RenderOps, C: CheckpointStrategy> RenderOps for Autodiff<B, C> {
    fn softras_images(
        positions: FloatTensor<Self>,
        colors: FloatTensor<Self>,
        texels: FloatTensor<Self>,
        cameras: FloatTensor<Self>,
        node: Node,
    ) -> FloatTensor<Self> {
        let (positions, of_positions) = positions.into_parts();
        let (colors, of_colors) = colors.into_parts();
        let (texels, of_texels) = texels.into_parts();
        let (cameras, of_cameras) = cameras.into_parts();
        let images = |node: &Node| B::softras_images(positions, colors, texels, cameras, node.clone());
        match RenderNode.prepare::<C>([of_positions, of_colors, of_texels, of_cameras]).compute_bound().stateful() {
            OpsKind::Tracked(step) => {
                let images = images(&node);
                step.finish(node, images)
            }
            OpsKind::UnTracked(step) => step.finish(images(&node)),
        }
    }
}

/// The packed images of a rendered frame, as a function of its inputs.
pub fn images(inputs: [Tensor<2>; 4], rendered: Rendered) -> Tensor<4> {
    let [positions, colors, texels, cameras] = inputs.map(Tensor::into_dispatch);
    Tensor::from_dispatch(Dispatch::softras_images(positions, colors, texels, cameras, Node(Arc::new(rendered))))
}
