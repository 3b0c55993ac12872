//! What Rust and the kernels share has one layout: the push constants' offsets are those of the SPIR-V, and every binding
//! finds a buffer of the element that the kernel reads.

use softras::internals::buffers::{ALIASES, BufferId};
use softras::internals::plan::FramePush;
use softras::internals::vulkan::{BindingKind, Kernel, TexelFormat, kernels};
use std::mem::offset_of;

/// Name and offset of every field of the Rust mirror.
fn rust_members() -> Vec<(&'static str, usize)> {
    macro_rules! fields {
        ($($name:ident),* $(,)?) => { vec![$((stringify!($name), offset_of!(FramePush, $name))),*] };
    }
    fields![
        width,
        height,
        tiles_x,
        tiles_y,
        bins_x,
        bins_y,
        coarse_capacity,
        list_capacity,
        scale,
        radius_squared,
        radius_pixels,
        barycentric_scale,
        barycentric_radius,
        near_high,
        near_low,
        far_high,
        far_low,
        score_high,
        score_low,
        background_exponent,
        background_fraction,
        background_red,
        background_green,
        background_blue,
        light_count,
        record_count,
        cell_capacity,
        view_count,
        mesh_count,
        number,
        first,
        texel_scale,
    ]
}

/// What differs between a kernel's push constants and the mirror.
fn difference(kernel: &Kernel, mirror: &[(&str, usize)]) -> Option<String> {
    let found: Vec<_> = kernel.push_members.iter().map(|m| (m.name, m.offset as usize)).collect();
    (found != mirror).then(|| format!("{}: {found:?}", kernel.name))
}

/// The kernels of a frame; the self-test, the measure of the peak, and what reads a host's geometry and writes its images
/// have blocks of their own.
fn kernels() -> impl Iterator<Item = &'static Kernel> {
    let others = ["selftest", "peak", "counts", "place", "store"];
    let is_other = move |k: &&Kernel| others.iter().any(|other| k.name.starts_with(other));
    kernels::ALL.iter().copied().filter(move |k| !is_other(k))
}

#[test]
fn push_constants_lie_as_the_kernels_have_them() {
    let mirror = rust_members();
    for kernel in kernels() {
        assert_eq!(difference(kernel, &mirror), None);
        assert_eq!(kernel.push_constant_bytes as usize, size_of::<FramePush>(), "{}", kernel.name);
    }
}

#[test]
fn a_wrong_mirror_is_noticed() {
    let mut moved = rust_members();
    moved[3].1 += 4;
    assert!(difference(&kernels::FORWARD, &moved).is_some());
    let mut renamed = rust_members();
    renamed[0].0 = "breadth";
    assert!(difference(&kernels::FORWARD, &renamed).is_some());
}

#[test]
fn every_binding_has_a_buffer_of_its_element() {
    for kernel in kernels() {
        for binding in kernel.bindings {
            // One of several buffers, chosen when the stage is bound, or the one of its name.
            let alias = ALIASES.iter().find(|(alias, _)| *alias == binding.name).map_or(&[][..], |(_, ids)| ids);
            let ids: Vec<_> = alias.iter().copied().chain(BufferId::of_binding(binding.name)).collect();
            assert!(!ids.is_empty(), "{}: no buffer for `{}`", kernel.name, binding.name);
            for id in ids {
                let format = id.row().format;
                let fits = match binding.kind {
                    BindingKind::UniformTexelBufferFloat => {
                        matches!(format, TexelFormat::Float | TexelFormat::Float2 | TexelFormat::Float4)
                    }
                    BindingKind::UniformTexelBufferUint => {
                        matches!(format, TexelFormat::Uint | TexelFormat::Uint2 | TexelFormat::Uint4)
                    }
                    BindingKind::UniformTexelBufferInt => matches!(format, TexelFormat::Int4),
                    BindingKind::StorageBuffer => true,
                    other => panic!("{}: {id} is a {other:?}", kernel.name),
                };
                assert!(fits, "{}: {id} is {format:?} read as {:?}", kernel.name, binding.kind);
            }
        }
    }
}
