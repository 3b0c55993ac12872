//! Rust source of the kernels' statics, as the library includes it.

use super::reflect::{Member, Reflection};
use std::fmt::Write;
use std::path::Path;

/// The Rust static of one kernel of `words` SPIR-V words, which lie beside the output as `NAME.spv`.
pub fn kernel(name: &str, source: &Path, words: usize, r: &Reflection) -> String {
    let push_bytes = r.push_members.iter().map(|m| m.offset + m.size).max().unwrap_or(0).next_multiple_of(4);
    let mut rust = format!("/// `{}`.\npub static {}: Kernel = Kernel {{\n", source.display(), name.to_uppercase());
    let spirv = format!("{{ static WORDS: [u32; {words}] = words(include_bytes!(\"{name}.spv\")); &WORDS }}");
    _ = writeln!(rust, "    name: {name:?},\n    spirv: {spirv},");
    _ = writeln!(rust, "    local_size: {:?},\n    local_size_ids: {:?},", r.local_size, r.local_size_ids);
    _ = writeln!(rust, "    capabilities: &{:?},\n    shared_bytes: {},", r.capabilities, r.shared_bytes);
    rust.push_str("    bindings: &[\n");
    for b in &r.bindings {
        let (name, binding, kind) = (&b.name, b.binding, b.kind);
        _ = writeln!(rust, "        Binding {{ name: {name:?}, binding: {binding}, kind: BindingKind::{kind} }},");
    }
    _ = writeln!(rust, "    ],\n    push_constant_bytes: {push_bytes},");
    _ = writeln!(rust, "    #[cfg(test)]\n    push_members: {},\n    specialization: &[", members(&r.push_members));
    for s in &r.specialization {
        let (name, id, default) = (&s.name, s.id, &s.default);
        _ = writeln!(rust, "        Specialization {{ name: {name:?}, id: {id}, default: SpecValue::{default} }},");
    }
    rust.push_str("    ],\n    #[cfg(test)]\n    structs: &[\n");
    for s in &r.structs {
        let (name, size, stride) = (&s.name, s.size, s.stride);
        let members = members(&s.members);
        _ = writeln!(rust, "        Struct {{ name: {name:?}, size: {size}, stride: {stride}, members: {members} }},");
    }
    rust.push_str("    ],\n};\n");
    rust
}

fn members(members: &[Member]) -> String {
    let mut rust = String::from("&[");
    for m in members {
        let (name, offset, size, stride) = (&m.name, m.offset, m.size, m.stride);
        _ = write!(rust, "Member {{ name: {name:?}, offset: {offset}, size: {size}, stride: {stride} }}, ");
    }
    rust.push(']');
    rust
}
