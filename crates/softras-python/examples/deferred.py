"""Deferred shading: shape, albedo and light from pictures, with a shader of one's own. Writes deferred.png.

softras draws what the shader needs as features: normals, places and albedo. The shader is plain torch: light from all around as
spherical harmonics of nine coefficients, and the gloss of one lamp by a microfacet model.
"""

import numpy as np
import torch
from PIL import Image

import softras
import softras.torch as st


def normals_of(vertices, faces):
    """The normals [V, 3] of vertices: the mean of the faces' around them, by area."""
    a, b, c = vertices[faces].unbind(1)
    by_area = torch.linalg.cross(b - a, c - a)
    return torch.nn.functional.normalize(torch.zeros_like(vertices).index_add(0, faces.flatten(), by_area.repeat_interleave(3, 0)), dim=1)


def irradiance(normal, light):
    """The light [..., 3] that a surface receives, from coefficients [9, 3]: the cosine lobe of spherical harmonics (Ramamoorthi and
    Hanrahan, An efficient representation for irradiance environment maps, 2001)."""
    x, y, z = normal.unbind(-1)
    basis = [0.886227 * torch.ones_like(x), 1.023328 * y, 1.023328 * z, 1.023328 * x]
    basis += [0.858086 * x * y, 0.858086 * y * z, 0.247708 * (3 * z * z - 1), 0.858086 * x * z, 0.429043 * (x * x - y * y)]
    return torch.stack(basis, -1) @ light


def gloss(normal, to_eye, to_lamp, roughness):
    """The reflectance times the cosine [...]: GGX facets with Smith's shadowing and Schlick's Fresnel term for plastic (Walter et al.,
    Microfacet models for refraction through rough surfaces, 2007)."""
    half = torch.nn.functional.normalize(to_eye + to_lamp, dim=-1)
    cosine = lambda a, b: (a * b).sum(-1).clamp(1e-3, 1.0)
    nh, nl, nv, vh = cosine(normal, half), cosine(normal, to_lamp), cosine(normal, to_eye), cosine(to_eye, half)
    a2 = roughness**4
    facets = a2 / (torch.pi * (nh * nh * (a2 - 1) + 1) ** 2)
    shadows = 4 / ((1 + (1 + a2 * (1 / (nl * nl) - 1)).sqrt()) * (1 + (1 + a2 * (1 / (nv * nv) - 1)).sqrt()))
    return facets * shadows * (0.04 + 0.96 * (1 - vh) ** 5) / (4 * nv)


def shaded(vertices, faces, cameras, albedo, light, lamp, roughness, settings):
    """The pictures [views, height, width, 3] before black, and their silhouettes."""
    features = torch.cat([normals_of(vertices, faces), vertices, albedo], 1)
    images = st.render(vertices, faces, cameras, features=features, settings=settings)
    alpha = images.silhouette[..., None]
    normal, place, albedo = (images.features / alpha.clamp(min=1e-4)).split(3, -1)
    normal = torch.nn.functional.normalize(normal, dim=-1, eps=1e-6)
    eyes = torch.tensor(np.array([-camera.view[:, :3].T @ camera.view[:, 3] for camera in cameras])).to(vertices)
    to_eye = torch.nn.functional.normalize(eyes[:, None, None] - place, dim=-1)
    to_lamp = torch.nn.functional.normalize(lamp - place, dim=-1)
    color = albedo * irradiance(normal, light) + gloss(normal, to_eye, to_lamp, roughness)[..., None]
    return alpha * color.clamp(min=0), images.silhouette


def main():
    fish = softras.shapes.fish()
    faces, true = torch.tensor(fish.triangles.astype(np.int64)), torch.tensor(fish.positions)
    stripes = 0.5 + 0.5 * torch.sin(9 * true[:, :1] + torch.tensor([0.0, 1.5, 3.0]))
    true_albedo = 0.15 + 0.7 * stripes
    true_light = torch.zeros(9, 3)
    true_light[0] = torch.tensor([0.55, 0.5, 0.5])
    true_light[1:4] = torch.tensor([[0.35, 0.3, 0.2], [0.1, 0.15, 0.2], [-0.2, 0.0, 0.2]])
    lamp = torch.tensor([1.5, 2.0, 2.5])
    cameras = [softras.Camera.from_angles(2.9, 35.0 * np.sin(i), 45.0 * i, fov_y=0.7) for i in range(8)]
    settings = softras.Settings(width=96, height=96, sigma=1e-4, gamma=1e-2, near=1.0, far=6.0, background="composite")
    with torch.no_grad():
        target, masks = shaded(true, faces, cameras, true_albedo, true_light, lamp, 0.35, settings)

    # The start: a thinner fish of grey, in white light.
    start = true * torch.tensor([1.0, 0.85, 0.7])
    moves = torch.zeros_like(true).requires_grad_()
    albedo = torch.full_like(true, 0.5).requires_grad_()
    light = torch.zeros(9, 3)
    light[0] = 0.6
    light.requires_grad_()
    optimizer = torch.optim.Adam([{"params": [moves], "lr": 2e-3}, {"params": [albedo, light], "lr": 2e-2}])
    first = None
    for step in range(300):
        vertices = start + moves
        pictures, silhouettes = shaded(vertices, faces, cameras, albedo, light, lamp, 0.35, settings)
        first = pictures.detach() if first is None else first
        loss = (pictures - target).abs().mean() + st.iou_loss(silhouettes, masks)
        # Neighbours move alike.
        loss = loss + 0.5 * st.laplacian_loss(moves, faces)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        with torch.no_grad():
            albedo.clamp_(0.0, 1.0)
        if step % 50 == 0:
            print(f"step {step}: loss {loss.item():.4f}")

    def error(a, b):
        return (a - b).norm(dim=-1).mean().item()

    # Light and albedo are known up to a factor of each channel.
    scale = (true_albedo * albedo).sum(0) / (albedo * albedo).sum(0)
    found = (scale * albedo).detach()
    print(f"places: error {error(start, true):.4f} at first, {error(vertices, true):.4f} at last")
    print(f"albedo: error {error(torch.full_like(true, 0.5), true_albedo):.3f} at first, {error(found, true_albedo):.3f} at last")
    print(f"pictures: error {(first - target).abs().mean():.4f} at first, {(pictures - target).abs().mean().item():.4f} at last")

    # The target, the start and the end; and the fish that was found in another light, as glossy as glass.
    with torch.no_grad():
        other = true_light.flip(1) * torch.tensor([1.0, -1.0, 1.0] * 3)[:, None]
        relit, _ = shaded(vertices, faces, cameras, found, other, torch.tensor([-2.0, 1.0, 2.5]), 0.2, settings)
    rows = [np.hstack(list(images[:4])) for images in (target.numpy(), first.numpy(), pictures.detach().numpy(), relit.numpy())]
    light = np.clip(np.vstack(rows), 0, 1)
    encoded = np.where(light > 0.0031308, 1.055 * light ** (1 / 2.4) - 0.055, 12.92 * light)
    Image.fromarray((255 * encoded).astype(np.uint8)).save("deferred.png")


if __name__ == "__main__":
    main()
