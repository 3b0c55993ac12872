//! Numpy arrays in the `.npy` format, versions 1 to 3, read from files that may claim anything.
//!
//! The crate npyz 0.9 does not read them, because a hostile header makes it allocate the 4 GiB that the header claims, parse
//! nested brackets in exponential time and overflow when it multiplies the sides of a shape; the tests write with it.

use std::io::Read;

/// The values of an array, in C order whatever the order in the file.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Numbers of any type, or bools as 0 and 1.
    Numbers(Vec<f64>),
    /// Unicode or byte strings.
    Texts(Vec<String>),
}

/// An array with its shape and the type that the file gave it.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// numpy's name for the type: "float32", "<U9".
    pub dtype: String,
    /// Empty for a 0-d array.
    pub shape: Vec<usize>,
    /// As many values as the product of the shape.
    pub values: Values,
}

/// The type of an element in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
    Bool,
    Unicode,
    Bytes,
}

struct Header {
    kind: Kind,
    /// Bytes of one element.
    size: usize,
    big_endian: bool,
    fortran: bool,
    shape: Vec<usize>,
}

/// The most values of one array, 4 GiB of numbers: a small file may claim more, and a compressed one may even contain more.
const MAX_VALUES: usize = 1 << 29;

/// Reads one array.
///
/// # Errors
/// A sentence that says what is wrong with the bytes.
pub fn read(mut source: impl Read) -> Result<Array, String> {
    let header = read_header(&mut source)?;
    let count = header.shape.iter().try_fold(1usize, |n, &side| n.checked_mul(side));
    let bytes = count.and_then(|n| n.checked_mul(header.size)).filter(|&n| n <= isize::MAX as usize);
    let (Some(count), Some(bytes)) = (count, bytes) else {
        return Err(format!("shape {:?} is larger than memory", header.shape));
    };
    // Texts of length 0 need no bytes, so the size of the file does not limit their number.
    if count > MAX_VALUES || (header.size == 0 && count > 1) {
        return Err(format!("shape {:?} is of more than {MAX_VALUES} values", header.shape));
    }
    let mut data = Vec::new();
    source.take(bytes as u64).read_to_end(&mut data).map_err(|e| format!("its data cannot be read ({e})"))?;
    if data.len() != bytes {
        return Err(format!("shape {:?} needs {bytes} bytes of data, the file has {}", header.shape, data.len()));
    }
    let values = decode(&header, &data, count);
    let values = if header.fortran { to_c_order(&values, &header.shape) } else { values };
    Ok(Array { dtype: dtype_name(&header), shape: header.shape, values })
}

fn read_header(source: &mut impl Read) -> Result<Header, String> {
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
    let mut text = Vec::new();
    source.take(length).read_to_end(&mut text).map_err(short)?;
    if text.len() as u64 != length {
        return Err("the file ends within its header".into());
    }
    parse_header(&String::from_utf8_lossy(&text))
}

/// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }`.
fn parse_header(text: &str) -> Result<Header, String> {
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
    Ok(Header { kind, size, big_endian, fortran: order.starts_with("True"), shape })
}

fn parse_descr(descr: &str) -> Result<(Kind, usize, bool), String> {
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
        ('f', 4 | 8) => (Kind::Float, size),
        ('i', 1 | 2 | 4 | 8) => (Kind::Signed, size),
        ('u', 1 | 2 | 4 | 8) => (Kind::Unsigned, size),
        ('b', 1) => (Kind::Bool, size),
        ('U', 0..=1_000_000) => (Kind::Unicode, size * 4),
        ('S' | 'a', 0..=1_000_000) => (Kind::Bytes, size),
        _ => return unsupported(),
    };
    Ok((kind, size, order == '>' || (order == '=' && cfg!(target_endian = "big"))))
}

fn dtype_name(header: &Header) -> String {
    let bits = header.size * 8;
    match header.kind {
        Kind::Float => format!("float{bits}"),
        Kind::Signed => format!("int{bits}"),
        Kind::Unsigned => format!("uint{bits}"),
        Kind::Bool => "bool".into(),
        Kind::Unicode => format!("<U{}", header.size / 4),
        Kind::Bytes => format!("S{}", header.size),
    }
}

fn decode(header: &Header, data: &[u8], count: usize) -> Values {
    let element = |i: usize| &data[i * header.size..(i + 1) * header.size];
    match header.kind {
        Kind::Unicode => Values::Texts((0..count).map(|i| unicode(element(i), header.big_endian)).collect()),
        Kind::Bytes => Values::Texts(
            (0..count).map(|i| String::from_utf8_lossy(element(i)).trim_end_matches('\0').to_string()).collect(),
        ),
        _ => Values::Numbers((0..count).map(|i| number(header, element(i))).collect()),
    }
}

/// One number; `bytes` has the size of its type.
fn number(header: &Header, bytes: &[u8]) -> f64 {
    let mut little = [0; 8];
    little[..bytes.len()].copy_from_slice(bytes);
    if header.big_endian {
        little[..bytes.len()].reverse();
    }
    let raw = u64::from_le_bytes(little);
    match header.kind {
        Kind::Float if header.size == 4 => f64::from(f32::from_bits(raw as u32)),
        Kind::Float => f64::from_bits(raw),
        Kind::Signed => {
            let unused = 64 - 8 * header.size as u32;
            ((raw << unused) as i64 >> unused) as f64
        }
        Kind::Bool => f64::from(u8::from(raw != 0)),
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

/// Reorders values from Fortran order (first index fastest) to C order (last index fastest).
fn to_c_order(values: &Values, shape: &[usize]) -> Values {
    fn permute<T: Clone>(values: &[T], shape: &[usize]) -> Vec<T> {
        let mut index = vec![0; shape.len()];
        let mut reordered = Vec::with_capacity(values.len());
        for _ in 0..values.len() {
            let at = index.iter().zip(shape).rev().fold(0, |at, (&i, &side)| at * side + i);
            reordered.push(values[at].clone());
            for axis in (0..shape.len()).rev() {
                index[axis] += 1;
                if index[axis] < shape[axis] {
                    break;
                }
                index[axis] = 0;
            }
        }
        reordered
    }
    match values {
        Values::Numbers(v) => Values::Numbers(permute(v, shape)),
        Values::Texts(v) => Values::Texts(permute(v, shape)),
    }
}

/// The values of an array to write.
#[derive(Clone, Copy, Debug)]
pub enum Data<'a> {
    /// float32.
    F32(&'a [f32]),
    /// float64.
    F64(&'a [f64]),
}

/// The bytes of a `.npy` file of version 1; the data starts at a multiple of 64 bytes.
pub fn write(shape: &[usize], data: Data<'_>) -> Vec<u8> {
    let sides: String = shape.iter().map(|s| format!("{s}, ")).collect();
    let sides = if shape.len() == 1 { sides.trim_end() } else { sides.trim_end_matches(", ") };
    let descr = if matches!(data, Data::F32(_)) { "<f4" } else { "<f8" };
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
    }
    bytes
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

    #[test]
    fn what_is_written_is_read() {
        for shape in [vec![], vec![3], vec![2, 3]] {
            let values: Vec<f64> = (0..shape.iter().product()).map(|i| i as f64 - 0.1).collect();
            let bytes = write(&shape, Data::F64(&values));
            assert_eq!((bytes.len() - 8 * values.len()) % 64, 0);
            let array = read(&bytes[..]).unwrap();
            assert_eq!((array.dtype.as_str(), array.shape), ("float64", shape));
            assert_eq!(array.values, Values::Numbers(values));
        }
    }

    #[test]
    fn fortran_order_and_signs_and_text() {
        let header = "{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }\n";
        let array = read(&file(header, &[0, 1, 255, 255, 0, 2, 0, 5, 0, 3, 0, 6])[..]).unwrap();
        assert_eq!(array.values, Values::Numbers(vec![1.0, 2.0, 3.0, -1.0, 5.0, 6.0]));
        let text: Vec<u8> = "surface\0\0".chars().flat_map(|c| (c as u32).to_le_bytes()).collect();
        let array = read(&file("{'descr': '<U9', 'fortran_order': False, 'shape': (), }\n", &text)[..]).unwrap();
        assert_eq!(array.values, Values::Texts(vec!["surface".into()]));
    }

    #[test]
    fn malformed_files_are_refused_with_a_reason() {
        let refused = |header: &str, data: &[u8]| read(&file(header, data)[..]).unwrap_err();
        let bad = refused("{'descr': '<f4', 'fortran_order': False, 'shape': (9, 9), }", &[0; 8]);
        assert!(bad.contains("324 bytes") && bad.contains("has 8"), "{bad}");
        let huge = "{'descr': '<f8', 'fortran_order': False, 'shape': (18446744073709551615, 9), }";
        assert!(refused(huge, &[]).contains("larger than memory"));
        // The product of the sides fits 64 bits here, so the limit on the number of values must refuse it.
        for descr in ["<U0", "|S0", "|u1"] {
            let many = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': (1000000000000000,), }}");
            assert!(refused(&many, &[]).contains("more than"), "{descr}");
        }
        assert!(refused("{'descr': '|O', 'fortran_order': False, 'shape': (), }", &[]).contains("not supported"));
        assert!(refused("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': ()}", &[]).contains("structured"));
        assert!(refused("{'descr': '<é', 'fortran_order': False, 'shape': (-1,)}", &[]).contains("not supported"));
        assert!(refused("{'descr': 'f4', 'fortran_order': False, 'shape': (-1,)}", &[]).contains("side"));
        assert!(read(&b"PK"[..]).is_err() && read(&[0u8; 64][..]).is_err());
    }
}
