//! Numpy arrays in the `.npy` format, versions 1 to 3, read from files that may claim anything.
//!
//! The crate npyz 0.9 does not read them, because a hostile header makes it allocate the 4 GiB that the header claims, parse
//! nested brackets in exponential time and overflow when it multiplies the sides of a shape.

use crate::refuse;
use std::{io::Read, path::Path};

/// An array with its shape and its values in the type that the file gives them.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Empty for a 0-d array.
    pub shape: Vec<usize>,
    kind: ArrayKind,
    /// Bytes of one element.
    size: usize,
    big_endian: bool,
    /// As many elements as the product of the shape, in C order whatever the order in the file.
    bytes: Vec<u8>,
}

#[expect(clippy::len_without_is_empty, reason = "an array without values is not a case of its own")]
impl Array {
    /// The number of values.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// numpy's name for the type: "float32", "<U9".
    pub fn dtype(&self) -> String {
        let bits = self.size * 8;
        match self.kind {
            ArrayKind::Float => format!("float{bits}"),
            ArrayKind::Signed => format!("int{bits}"),
            ArrayKind::Unsigned => format!("uint{bits}"),
            ArrayKind::Bool => "bool".into(),
            ArrayKind::Unicode => format!("<U{}", self.size / 4),
            ArrayKind::Bytes => format!("S{}", self.size),
        }
    }

    /// Its numbers, bools as 0 and 1; `None` for text.
    pub fn numbers(&self) -> Option<Numbers<'_>> {
        (!matches!(self.kind, ArrayKind::Unicode | ArrayKind::Bytes)).then_some(Numbers(self))
    }

    /// Its bytes; `None` for another type than uint8.
    pub fn bytes(&self) -> Option<&[u8]> {
        (self.kind == ArrayKind::Unsigned && self.size == 1).then_some(&self.bytes)
    }

    /// Its texts; `None` for numbers.
    pub fn texts(&self) -> Option<impl Iterator<Item = String> + '_> {
        let text = |i: usize| match self.kind {
            ArrayKind::Unicode => unicode(self.element(i), self.big_endian),
            _ => String::from_utf8_lossy(self.element(i)).trim_end_matches('\0').to_string(),
        };
        self.numbers().is_none().then(|| (0..self.len()).map(text))
    }

    fn element(&self, i: usize) -> &[u8] {
        &self.bytes[i * self.size..(i + 1) * self.size]
    }
}

/// The numbers of an array, each converted when it is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<'a>(&'a Array);

#[expect(clippy::len_without_is_empty, reason = "an array without values is not a case of its own")]
impl<'a> Numbers<'a> {
    /// How many there are.
    pub fn len(self) -> usize {
        self.0.len()
    }

    /// Number `i`, which must be below the count.
    pub fn at(self, i: usize) -> f64 {
        number(self.0.kind, self.0.big_endian, self.0.element(i))
    }

    /// All of them.
    pub fn iter(self) -> impl ExactSizeIterator<Item = f64> + Clone + 'a {
        (0..self.len()).map(move |i| self.at(i))
    }

    /// All of them, where there are N.
    pub fn all<const N: usize>(self) -> Option<[f64; N]> {
        (self.len() == N).then(|| std::array::from_fn(|i| self.at(i)))
    }
}

/// The type of an element in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum ArrayKind {
    Float,
    Signed,
    Unsigned,
    Bool,
    Unicode,
    Bytes,
}

struct ArrayHeader {
    kind: ArrayKind,
    /// Bytes of one element.
    size: usize,
    big_endian: bool,
    fortran: bool,
    shape: Vec<usize>,
}

/// The longest header; numpy itself reads 10,000 bytes.
const MAX_HEADER: u64 = 1 << 16;
/// The longest text of an array of texts, in characters.
const MAX_TEXT: usize = 1_000_000;

/// Reads one array. Before its data are read, `admit` is told how many bytes they are and may refuse them.
///
/// # Errors
/// A sentence that says what is wrong with the bytes, or what `admit` says.
pub fn read(mut source: impl Read, admit: impl FnOnce(u64) -> Result<(), String>) -> Result<Array, String> {
    let ArrayHeader { kind, size, big_endian, fortran, shape } = read_header(&mut source)?;
    let count = shape.iter().try_fold(1usize, |n, &side| n.checked_mul(side));
    let bytes = count.and_then(|n| n.checked_mul(size)).filter(|&n| n <= isize::MAX as usize);
    let (Some(count), Some(bytes)) = (count, bytes) else {
        return Err(format!("shape {shape:?} is larger than memory"));
    };
    // Texts of length 0 need no bytes, so the size of the file does not limit their number.
    if size == 0 && count > 1 {
        return Err(format!("shape {shape:?} is of more than one text without characters"));
    }
    // Sorting them into C order needs them twice.
    admit(if fortran { 2 * bytes as u64 } else { bytes as u64 })?;
    let mut data = Vec::new();
    // This asks for memory in such a way that a lack of it is an error.
    source.take(bytes as u64).read_to_end(&mut data).map_err(|e| format!("its data cannot be read ({e})"))?;
    if data.len() != bytes {
        return Err(format!("shape {shape:?} needs {bytes} bytes of data, the file has {}", data.len()));
    }
    let bytes = if fortran && shape.len() > 1 { to_c_order(&data, &shape, size)? } else { data };
    Ok(Array { shape, kind, size, big_endian, bytes })
}

fn read_header(source: &mut impl Read) -> Result<ArrayHeader, String> {
    let short = |_| "the file ends within its header".to_string();
    let mut start = [0; 8];
    source.read_exact(&mut start).map_err(short)?;
    if start[..6] != *b"\x93NUMPY" {
        return Err("it does not begin as a .npy file".into());
    }
    let length = if start[6] == 1 {
        let mut length = [0; 2];
        source.read_exact(&mut length).map_err(short)?;
        u64::from(u16::from_le_bytes(length))
    } else {
        let mut length = [0; 4];
        source.read_exact(&mut length).map_err(short)?;
        u64::from(u32::from_le_bytes(length))
    };
    if length > MAX_HEADER {
        return Err(format!("its header is of {length} bytes"));
    }
    let mut text = Vec::new();
    source.take(length).read_to_end(&mut text).map_err(short)?;
    if text.len() as u64 != length {
        return Err("the file ends within its header".into());
    }
    parse_header(&String::from_utf8_lossy(&text))
}

/// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`.
fn parse_header(text: &str) -> Result<ArrayHeader, String> {
    let field = |name: &str| {
        let at = text.find(&format!("'{name}'")).or_else(|| text.find(&format!("\"{name}\"")));
        at.and_then(|at| text[at..].split_once(':')).map(|(_, rest)| rest.trim_start())
    };
    let (Some(descr), Some(order), Some(shape)) = (field("descr"), field("fortran_order"), field("shape")) else {
        return Err("its header lacks descr, fortran_order or shape".into());
    };
    let quote = descr.chars().next().unwrap_or(' ');
    let Some(descr) = descr.strip_prefix(['\'', '"']).and_then(|d| d.split_once(quote)).map(|(d, _)| d) else {
        return Err("structured arrays are not supported: save each field as an array of its own".into());
    };
    let (kind, size, big_endian) = parse_descr(descr)?;
    let Some(inner) = shape.strip_prefix('(').and_then(|s| s.split_once(')')).map(|(s, _)| s) else {
        return Err("its header's shape is not a tuple".into());
    };
    let sides = inner.split(',').map(str::trim).filter(|s| !s.is_empty());
    let shape = sides.map(|s| s.trim_end_matches('L').parse().map_err(|_| format!("its shape has a side of {s:?}")));
    let shape = shape.collect::<Result<Vec<usize>, String>>()?;
    if shape.len() > 32 {
        return Err(format!("{} dimensions are more than numpy has", shape.len()));
    }
    Ok(ArrayHeader { kind, size, big_endian, fortran: order.starts_with("True"), shape })
}

fn parse_descr(descr: &str) -> Result<(ArrayKind, usize, bool), String> {
    let unsupported = || {
        let types = "float32, float64, int and uint of 8 to 64 bits, bool, str";
        Err(format!("type {descr:?} is not supported: save it as one of {types}"))
    };
    let (order, rest) = match descr.chars().next() {
        Some(c @ ('<' | '>' | '|' | '=')) => (c, &descr[1..]),
        _ => ('=', descr),
    };
    let (Some(letter), Ok(size)) = (rest.chars().next(), rest.get(1..).unwrap_or("").parse::<usize>()) else {
        return unsupported();
    };
    let (kind, size) = match (letter, size) {
        ('f', 4 | 8) => (ArrayKind::Float, size),
        ('i', 1 | 2 | 4 | 8) => (ArrayKind::Signed, size),
        ('u', 1 | 2 | 4 | 8) => (ArrayKind::Unsigned, size),
        ('b', 1) => (ArrayKind::Bool, size),
        ('U', 0..=MAX_TEXT) => (ArrayKind::Unicode, size * 4),
        ('S' | 'a', 0..=MAX_TEXT) => (ArrayKind::Bytes, size),
        _ => return unsupported(),
    };
    Ok((kind, size, order == '>' || (order == '=' && cfg!(target_endian = "big"))))
}

/// One number; `bytes` has the size of its type.
fn number(kind: ArrayKind, big_endian: bool, bytes: &[u8]) -> f64 {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        little[..bytes.len()].reverse();
    }
    let raw = u64::from_le_bytes(little);
    match kind {
        ArrayKind::Float if bytes.len() == 4 => f64::from(f32::from_bits(raw as u32)),
        ArrayKind::Float => f64::from_bits(raw),
        ArrayKind::Signed => {
            let unused = 64 - 8 * bytes.len() as u32;
            ((raw << unused) as i64 >> unused) as f64
        }
        ArrayKind::Bool => f64::from(u8::from(raw != 0)),
        _ => raw as f64,
    }
}

fn unicode(bytes: &[u8], big_endian: bool) -> String {
    let units = bytes.chunks_exact(4).map(|c| {
        let unit = [c[0], c[1], c[2], c[3]];
        if big_endian { u32::from_be_bytes(unit) } else { u32::from_le_bytes(unit) }
    });
    let text: String = units.map(|u| char::from_u32(u).unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    text.trim_end_matches('\0').to_string()
}

/// Reorders elements from Fortran order (first index fastest) to C order (last index fastest).
fn to_c_order(bytes: &[u8], shape: &[usize], size: usize) -> Result<Vec<u8>, String> {
    let mut index = vec![0; shape.len()];
    let mut reordered = Vec::new();
    reordered.try_reserve_exact(bytes.len()).map_err(|e| format!("its data cannot be sorted ({e})"))?;
    while reordered.len() < bytes.len() {
        let at = size * index.iter().zip(shape).rev().fold(0, |at, (&i, &side)| at * side + i);
        reordered.extend_from_slice(&bytes[at..at + size]);
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    Ok(reordered)
}

/// The values of an array to write.
#[derive(Clone, Copy, Debug)]
pub enum Data<'a> {
    /// float32.
    F32(&'a [f32]),
    /// float64.
    F64(&'a [f64]),
    /// uint8.
    U8(&'a [u8]),
}

/// The bytes of a `.npy` file of version 1; the data starts at a multiple of 64 bytes.
pub fn write(shape: &[usize], data: Data<'_>) -> Vec<u8> {
    let sides: String = shape.iter().map(|s| format!("{s}, ")).collect();
    let sides = if shape.len() == 1 { sides.trim_end() } else { sides.trim_end_matches(", ") };
    let descr = match data {
        Data::F32(_) => "<f4",
        Data::F64(_) => "<f8",
        Data::U8(_) => "|u1",
    };
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({sides}), }}");
    let padding = 64 - (10 + header.len() + 1) % 64;
    header.push_str(&" ".repeat(padding % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    match data {
        Data::F32(values) => values.iter().for_each(|v| bytes.extend(v.to_le_bytes())),
        Data::F64(values) => values.iter().for_each(|v| bytes.extend(v.to_le_bytes())),
        Data::U8(values) => bytes.extend(values),
    }
    bytes
}

/// Reads a .npy file of finite numbers, with memory from a budget.
///
/// # Errors
/// [`softras::Error::File`] for what is no such file, or larger than the budget; [`softras::Error::Io`].
pub fn read_file(path: &Path, budget: &crate::Budget) -> softras::Result<Array> {
    let file = crate::input::open(path)?;
    let bytes = file.metadata().map_or(0, |metadata| metadata.len());
    crate::input::refuse_empty(path, bytes)?;
    budget.count_file(bytes);
    let room = |bytes| budget.claim(path, "the array", bytes).map_err(|error| error.to_string());
    let array = match read(std::io::BufReader::new(file), room) {
        Ok(array) => array,
        Err(what) => return refuse(path, what, "write it with numpy.save, as a plain array"),
    };
    let odd = numbers(path, &array)?.iter().enumerate().find(|(_, x)| !x.is_finite());
    match odd {
        Some((i, x)) => refuse(path, format!("value {i} is {x:?}"), "every number must be finite"),
        None => Ok(array),
    }
}

/// The numbers of a file's array.
///
/// # Errors
/// [`softras::Error::File`] for text.
pub fn numbers<'a>(path: &Path, array: &'a Array) -> softras::Result<Numbers<'a>> {
    match array.numbers() {
        Some(numbers) => Ok(numbers),
        None => refuse(path, format!("holds text ({})", array.dtype()), "numbers are expected"),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    fn numbers(array: &Array) -> Vec<f64> {
        array.numbers().unwrap().iter().collect()
    }

    #[test]
    fn what_is_written_is_read() {
        for shape in [vec![], vec![3], vec![2, 3]] {
            let values: Vec<f64> = (0..shape.iter().product()).map(|i| i as f64 - 0.1).collect();
            let bytes = write(&shape, Data::F64(&values));
            assert_eq!((bytes.len() - 8 * values.len()) % 64, 0);
            let array = read(&bytes[..], |_| Ok(())).unwrap();
            assert_eq!((array.dtype().as_str(), &array.shape), ("float64", &shape));
            assert_eq!(numbers(&array), values);
            assert_eq!(array.bytes(), None);
        }
        let array = read(&write(&[2, 1], Data::U8(&[3, 255]))[..], |_| Ok(())).unwrap();
        assert_eq!((array.dtype().as_str(), &array.shape, array.bytes()), ("uint8", &vec![2, 1], Some(&[3, 255][..])));
    }

    #[test]
    fn fortran_order_and_signs_and_text() {
        let header = "{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }\n";
        let mut asked = 0;
        let admit = |bytes| {
            asked = bytes;
            Ok(())
        };
        let array = read(&file(header, &[0, 1, 255, 255, 0, 2, 0, 5, 0, 3, 0, 6])[..], admit).unwrap();
        assert_eq!(numbers(&array), [1.0, 2.0, 3.0, -1.0, 5.0, 6.0]);
        assert_eq!((asked, array.numbers().unwrap().all::<6>().map(|all| all[3])), (24, Some(-1.0)));
        let text: Vec<u8> = "surface\0\0".chars().flat_map(|c| (c as u32).to_le_bytes()).collect();
        let header = "{'descr': '<U9', 'fortran_order': False, 'shape': (), }\n";
        let array = read(&file(header, &text)[..], |_| Ok(())).unwrap();
        assert_eq!(array.texts().unwrap().collect::<Vec<_>>(), ["surface"]);
        assert!(array.numbers().is_none());
    }

    #[test]
    fn malformed_files_are_refused_with_a_reason() {
        let refused = |header: &str, data: &[u8]| read(&file(header, data)[..], |_| Ok(())).unwrap_err();
        let bad = refused("{'descr': '<f4', 'fortran_order': False, 'shape': (9, 9), }", &[0; 8]);
        assert!(bad.contains("324 bytes") && bad.contains("has 8"), "{bad}");
        let huge = "{'descr': '<f8', 'fortran_order': False, 'shape': (18446744073709551615, 9), }";
        assert!(refused(huge, &[]).contains("larger than memory"));
        // The product of the sides fits 64 bits here.
        for descr in ["<U0", "|S0"] {
            let many = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1000000000000000,), }}");
            assert!(refused(&many, &[]).contains("more than"), "{descr}");
        }
        let bytes = file("{'descr': '|u1', 'fortran_order': False, 'shape': (100,), }", &[0; 100]);
        assert_eq!(read(&bytes[..], |bytes| Err(format!("{bytes} are too many"))).unwrap_err(), "100 are too many");
        let long = format!("{{'descr': '|u1', {}'fortran_order': False, 'shape': (0,), }}", " ".repeat(70_000));
        let long = [&b"\x93NUMPY\x02\x00"[..], &(long.len() as u32).to_le_bytes(), long.as_bytes()].concat();
        assert!(read(&long[..], |_| Ok(())).unwrap_err().contains("header is of 70"));
        assert!(refused("{'descr': '|O', 'fortran_order': False, 'shape': (), }", &[]).contains("not supported"));
        assert!(refused("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': ()}", &[]).contains("structured"));
        assert!(refused("{'descr': '<é', 'fortran_order': False, 'shape': (-1,)}", &[]).contains("not supported"));
        assert!(refused("{'descr': 'f4', 'fortran_order': False, 'shape': (-1,)}", &[]).contains("side"));
        assert!(read(&b"PK"[..], |_| Ok(())).is_err() && read(&[0u8; 64][..], |_| Ok(())).is_err());
    }
}
