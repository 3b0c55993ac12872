//! The files of `glsl/` that are compiled more than once, each time with other macros.

use super::compile::Macro;

/// A variant: the suffix that its name has after the file's, and its macros.
type Variant = (&'static str, &'static [Macro]);

const BY_LANES: Variant = ("_subgroup", &[("SUBGROUP_RECORDS", "1")]);

/// Every such file with its variants.
const FILES: [(&str, &[Variant]); 4] = [
    ("forward", &[("", &[]), BY_LANES, ("_long", &[("WALKED", "1")])]),
    ("forward_soft", &[("", &[]), BY_LANES, ("_long", &[("WALKED", "1")])]),
    ("backward", &[("", &[]), BY_LANES, ("_long", &[("LONG", "1")])]),
    (
        "store",
        &[
            ("_r32f", &[("STORE_FORMAT", "r32f"), ("STORE_CHANNELS", "1")]),
            ("_rgba16f", &[("STORE_FORMAT", "rgba16f"), ("STORE_CHANNELS", "4")]),
            ("_rgba32f", &[("STORE_FORMAT", "rgba32f"), ("STORE_CHANNELS", "4")]),
            ("_rgba8", &[("STORE_FORMAT", "rgba8"), ("STORE_CHANNELS", "4")]),
        ],
    ),
];

/// The variants of the file of that name: one without macros unless it is listed.
pub fn variants_of(file: &str) -> &'static [Variant] {
    FILES.iter().find(|(name, _)| *name == file).map_or(&[("", &[])], |(_, variants)| variants)
}
