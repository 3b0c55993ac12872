"""Uses the public functions of softras.torch and softras.soft_renderer, for `mypy --strict`."""

import torch

import softras
import softras.soft_renderer as sr
import softras.soft_renderer.functional as srf
import softras.torch as st


def everything(vertices: torch.Tensor, faces: torch.Tensor, cameras: list[softras.Camera]) -> torch.Tensor:
    images: st.Images = st.render(vertices, faces, cameras)
    found: st.Fragments = st.fragments(vertices, faces, cameras)
    view = st.rigid_motion(torch.zeros(6)) @ st.look_at(vertices[0], vertices[1], vertices[2])
    also: st.Images = st.Rasterizer(softras.Settings())(vertices, faces, cameras, views=view[None])
    points = st.sample_surface(vertices, faces, 100)
    losses = st.edge_length_loss(vertices, faces) + st.normal_consistency_loss(vertices, faces) + st.flatten_loss(vertices, faces)
    losses = losses + st.laplacian_loss(vertices, faces, "cotangent") + st.chamfer_distance(points, vertices)
    assert images.silhouette is not None and also.silhouette is not None
    return losses + st.iou_loss(images.silhouette, also.silhouette) + st.interpolate(found, vertices, faces).sum()


def official(path: str) -> torch.Tensor:
    mesh: sr.Mesh = sr.Mesh.from_obj(path, load_texture=True)
    renderer = sr.SoftRenderer(camera_mode="look_at", image_height=32, image_width=48)
    renderer.transform.set_eyes_from_angles(2.7, 30.0, 0.0)
    renderer.set_sigma(1e-4)
    images: torch.Tensor = renderer.render_mesh(mesh)
    mesh.reset_()
    mesh.save_obj(path, save_texture=True)
    lit: sr.Mesh = sr.Lighting("surface")(mesh)
    vertices = srf.look_at(lit.vertices, srf.get_points_from_angles(2.7, 30.0, 0.0))
    corners = srf.face_vertices(srf.perspective(vertices), lit.faces)
    loss: torch.Tensor = sr.LaplacianLoss(mesh.vertices[0], mesh.faces[0])(mesh.vertices)
    flat: torch.Tensor = sr.FlattenLoss(mesh.faces[0])(mesh.vertices)
    return images + srf.soft_rasterize(corners, lit.textures) + loss + flat + srf.voxelization(corners, 8) + mesh.voxelize()
