//! Reads the arrays of a glTF file: positions, colours, UVs, indices, matrices.

use super::{
    GltfWrong,
    document::Document,
    json::{Accessor, SparsePart},
    lacks,
};
use crate::{color, source::Source, within};

/// The most elements of an accessor without data in the file, which are zeros.
const MOST_ZEROS: usize = 1 << 20;

/// The type of a component.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum ComponentType {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl ComponentType {
    fn of(number: usize) -> Option<Self> {
        Some(match number {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// The number of bytes of a component.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The bytes of a number.
    #[cfg(feature = "packed")]
    pub(super) fn bytes(self, x: f32) -> impl Iterator<Item = u8> {
        let whole = (x as i64).to_le_bytes();
        let float = x.to_le_bytes();
        (0..self.size()).map(move |i| if self == Self::F32 { float[i] } else { whole[i] })
    }

    /// The value of a component, as a number or as a share of the largest.
    fn value(self, is_share: bool, bytes: &[u8]) -> f32 {
        let share = |x: f32, most: f32| if is_share { (x / most).max(-1.0) } else { x };
        match (self, bytes) {
            (Self::I8, &[a, ..]) => share(f32::from(a as i8), 127.0),
            (Self::U8, &[a, ..]) => share(f32::from(a), 255.0),
            (Self::I16, &[a, b, ..]) => share(f32::from(i16::from_le_bytes([a, b])), 32767.0),
            (Self::U16, &[a, b, ..]) => share(f32::from(u16::from_le_bytes([a, b])), 65535.0),
            (Self::U32, &[a, b, c, d, ..]) => share(u32::from_le_bytes([a, b, c, d]) as f32, u32::MAX as f32),
            (Self::F32, &[a, b, c, d, ..]) => f32::from_le_bytes([a, b, c, d]),
            _ => 0.0,
        }
    }
}

/// A whole number of one, two or four bytes.
fn whole(bytes: &[u8]) -> u32 {
    match *bytes {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}

impl Document<'_> {
    /// Vectors of `N` components; further components of the file are left out, and those that it lacks are 1.
    pub fn vectors<const N: usize>(&mut self, source: &mut Source, index: usize) -> Result<Vec<[f32; N]>, GltfWrong> {
        let is_share = self.accessor(index)?.0.normalized;
        self.scaled(source, index, is_share)
    }

    /// Colours with alpha. Whole numbers are shares of the largest, also where the file does not say so; floats up to 255 are bytes.
    pub fn colors(&mut self, source: &mut Source, index: usize) -> Result<Vec<[f32; 4]>, GltfWrong> {
        let is_whole = self.accessor(index)?.1 != ComponentType::F32;
        let mut colors = self.scaled::<4>(source, index, is_whole)?;
        if !is_whole && color::are_bytes(colors.iter().flat_map(|color| color[..3].iter().copied())) {
            source.notes.count(None, "colours up to 255 are divided by 255");
            colors.iter_mut().flatten().for_each(|x| *x /= 255.0);
        }
        for color in &mut colors {
            if !color::is_color(&[color[0], color[1], color[2]]) || color[3].is_nan() {
                source.notes.count(None, color::BAD);
                *color = [1.0; 4];
            }
        }
        Ok(colors)
    }

    fn scaled<const N: usize>(
        &mut self,
        source: &mut Source,
        index: usize,
        is_share: bool,
    ) -> Result<Vec<[f32; N]>, GltfWrong> {
        let (accessor, kind) = self.accessor(index)?;
        let (has, least) = (components(accessor), kind.size());
        // Colours may lack their alpha.
        let needed = if N == 4 { 3 } else { N };
        // Columns of matrices of bytes or shorts are padded to four bytes, which is not handled: glTF has such matrices nowhere.
        let value = |bytes: &[u8], k: usize| if k < has { kind.value(is_share, &bytes[k * least..]) } else { 1.0 };
        self.elements(source, index, needed, |bytes| std::array::from_fn(|k| value(bytes, k)))
    }

    /// Whole numbers.
    pub fn indices(&mut self, source: &mut Source, index: usize) -> Result<Vec<u32>, GltfWrong> {
        self.refuse_fractions(index)?;
        self.elements(source, index, 1, whole)
    }

    /// Four whole numbers each.
    pub fn joints(&mut self, source: &mut Source, index: usize) -> Result<Vec<[u32; 4]>, GltfWrong> {
        let size = self.refuse_fractions(index)?.size();
        self.elements(source, index, 4, |bytes| std::array::from_fn(|k| whole(&bytes[k * size..(k + 1) * size])))
    }

    fn refuse_fractions(&self, index: usize) -> Result<ComponentType, GltfWrong> {
        match self.accessor(index)?.1 {
            kind @ (ComponentType::U8 | ComponentType::U16 | ComponentType::U32) => Ok(kind),
            _ => {
                let what = format!("accessor {index}: indices must be unsigned whole numbers");
                Err((what, "give them the componentType 5121, 5123 or 5125".into()))
            }
        }
    }

    pub(super) fn accessor(&self, index: usize) -> Result<(&Accessor, ComponentType), GltfWrong> {
        let all = &self.root.accessors;
        let accessor = all.get(index).ok_or_else(|| lacks("accessor", index, all.len()))?;
        let types = "use 5120 to 5123, 5125 or 5126";
        let wrong = || (format!("accessor {index} has the componentType {}", accessor.component_type.0), types.into());
        ComponentType::of(accessor.component_type.0).map(|kind| (accessor, kind)).ok_or_else(wrong)
    }

    /// Reads each element from its bytes. Elements must have at least `needed` components.
    fn elements<T: Clone>(
        &mut self,
        source: &mut Source,
        index: usize,
        needed: usize,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GltfWrong> {
        let (accessor, kind) = self.accessor(index)?;
        let has = components(accessor);
        if has < needed {
            let what = format!("accessor {index} has {has} components, {needed} are needed");
            return Err((what, "give it the type that its attribute has: VEC3 for positions, VEC2 for UVs".into()));
        }
        let (element, count, offset) = (has * kind.size(), accessor.count.0, accessor.byte_offset.0);
        if let Some(bytes) = self.unpacked.get(&index) {
            return Ok(bytes.chunks_exact(element).map(read).collect());
        }
        let sparse = accessor.sparse.as_ref();
        let sparse = sparse.map(|sparse| (sparse.count.0, part(&sparse.indices), part(&sparse.values)));
        let mut values = match accessor.buffer_view.map(|view| view.0) {
            Some(view) => self.strided(source, (view, offset), element, count, &read),
            // Without data an accessor holds zeros, which take no bytes of the file.
            None if count > MOST_ZEROS.max(self.held) => {
                Err((format!("{count} elements without data"), "give the accessor a bufferView".into()))
            }
            None => Ok(vec![read(&vec![0; element]); count]),
        }
        .map_err(within(format!("accessor {index}")))?;
        if let Some((changed, indices, new)) = sparse {
            let size = ComponentType::of(indices.1).map_or(0, ComponentType::size);
            let at = self.strided(source, indices.0, size, changed, &whole)?;
            let new = self.strided(source, new.0, element, changed, &read)?;
            for (at, new) in at.into_iter().zip(new) {
                let outside = || lacks(&format!("accessor {index}: sparse index"), at as usize, count);
                *values.get_mut(at as usize).ok_or_else(outside)? = new;
            }
        }
        Ok(values)
    }

    /// Reads `count` elements of `element` bytes from a place in a view: its number and an offset.
    fn strided<T>(
        &mut self,
        source: &mut Source,
        (view, offset): (usize, usize),
        element: usize,
        count: usize,
        read: &impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, GltfWrong> {
        let (view, stride) = self.view(source, view)?;
        let stride = if stride > 0 { stride } else { element };
        let bytes = view.bytes();
        let length = (stride as u64).saturating_mul((count as u64).saturating_sub(1)).saturating_add(element as u64);
        let end = (offset as u64).saturating_add(if count == 0 { 0 } else { length });
        if end > bytes.len() as u64 || stride < element || element == 0 {
            let what = format!("{count} elements, more than its view of {} bytes", bytes.len());
            return Err((what, super::AGAIN.into()));
        }
        Ok((0..count).map(|i| read(&bytes[offset + i * stride..][..element])).collect())
    }
}

/// A part of a sparse accessor: its view and offset, and the type of its components.
fn part(part: &SparsePart) -> ((usize, usize), usize) {
    ((part.buffer_view.0, part.byte_offset.0), part.component_type.0)
}

pub(super) fn components(accessor: &Accessor) -> usize {
    match accessor.kind.as_str() {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => 0,
    }
}
