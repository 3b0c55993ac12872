//! Reads the arrays of a glTF file: positions, colours, UVs, indices.

use super::document::Document;
use crate::source::Source;
use gltf_json::{
    accessor::{Accessor, ComponentType, Type},
    validation::Checked,
};

/// The bytes of a component.
fn size(kind: ComponentType) -> usize {
    match kind {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

/// The value of a component, as a number or as a share of the largest.
fn value(kind: ComponentType, is_share: bool, bytes: &[u8]) -> f32 {
    let share = |x: f32, most: f32| if is_share { (x / most).max(-1.0) } else { x };
    match (kind, bytes) {
        (ComponentType::I8, &[a, ..]) => share(f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a, ..]) => share(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b, ..]) => share(f32::from(i16::from_le_bytes([a, b])), 32767.0),
        (ComponentType::U16, &[a, b, ..]) => share(f32::from(u16::from_le_bytes([a, b])), 65535.0),
        (ComponentType::U32, &[a, b, c, d, ..]) => share(u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32),
        (ComponentType::F32, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]),
        _ => 0.0,
    }
}

impl Document<'_> {
    /// Vectors of `N` components; further components of the file are left out.
    pub fn vectors<const N: usize>(&mut self, source: &mut Source, index: usize) -> Result<Vec<[f32; N]>, String> {
        let (accessor, kind) = self.accessor(index)?;
        let is_share = accessor.normalized;
        let least = size(kind);
        self.elements(source, index, N, |bytes| {
            std::array::from_fn(|k| value(kind, is_share, bytes.get(k * least..).unwrap_or_default()))
        })
    }

    /// Whole numbers.
    pub fn indices(&mut self, source: &mut Source, index: usize) -> Result<Vec<u32>, String> {
        let (_, kind) = self.accessor(index)?;
        if !matches!(kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(format!("accessor {index}: indices must be unsigned whole numbers"));
        }
        self.elements(source, index, 1, |bytes| match *bytes {
            [a] => u32::from(a),
            [a, b] => u32::from(u16::from_le_bytes([a, b])),
            [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
            _ => 0,
        })
    }

    fn accessor(&self, index: usize) -> Result<(&Accessor, ComponentType), String> {
        let count = self.root.accessors.len();
        let accessor =
            self.root.accessors.get(index).ok_or_else(|| format!("accessor {index} but there are {count}"))?;
        match &accessor.component_type {
            Checked::Valid(kind) => Ok((accessor, kind.0)),
            Checked::Invalid => Err(format!("accessor {index} has an unknown component type")),
        }
    }

    /// Reads each element, which must have at least so many components, from its bytes.
    fn elements<T>(
        &mut self,
        source: &mut Source,
        index: usize,
        components: usize,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let (accessor, kind) = self.accessor(index)?;
        let has = match accessor.type_ {
            Checked::Valid(Type::Scalar) => 1,
            Checked::Valid(Type::Vec2) => 2,
            Checked::Valid(Type::Vec3) => 3,
            Checked::Valid(Type::Vec4) => 4,
            _ => 0,
        };
        if has < components {
            return Err(format!("accessor {index} has {has} components, {components} are needed"));
        }
        if accessor.sparse.is_some() {
            return Err(format!("accessor {index} is sparse, which softras does not read"));
        }
        let Some(view) = accessor.buffer_view else { return Err(format!("accessor {index} has no data")) };
        let (start, count) = (accessor.byte_offset.map_or(0, |offset| offset.0), accessor.count.0);
        let element = has * size(kind);
        let (view, stride) = self.view(source, view.value())?;
        let stride = stride.filter(|&stride| stride > 0).unwrap_or(element);
        let bytes = view.bytes();
        let length = (stride as u64).saturating_mul(count.saturating_sub(1)).saturating_add(element as u64);
        let end = start.saturating_add(if count == 0 { 0 } else { length });
        if end > bytes.len() as u64 || stride < element {
            return Err(format!("accessor {index} has {count} elements, more than its view of {} bytes", bytes.len()));
        }
        let at = |i: u64| (start + i * stride as u64) as usize;
        Ok((0..count).map(|i| read(&bytes[at(i)..at(i) + element])).collect())
    }
}
