//! The header of a PLY file, and its rows as numbers.
//!
//! The crate serde-ply is not used: it reads the rows of a text as one stream of words, so that a word too many in a row shifts
//! all rows behind it, and refuses names and numbers as programs write them.

use crate::{Wrong, text};
use std::ops::Range;

const AGAIN: &str = "copy or download the file again";
const HEADER: &str =
    "export the file again: a PLY header names a format, elements and properties, and ends in end_header";

/// The type of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberType {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl NumberType {
    fn of(name: &str) -> Result<Self, Wrong> {
        Ok(match name.to_ascii_lowercase().as_str() {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return Err((format!("unknown type {:?}", text::name(name)), "use char, short, int, float or double")),
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number of bytes in little-endian order, with zeros behind.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let whole = u64::from_le_bytes(bytes);
        match self {
            Self::I8 => (whole as i8).into(),
            Self::U8 => (whole as u8).into(),
            Self::I16 => (whole as i16).into(),
            Self::U16 => (whole as u16).into(),
            Self::I32 => (whole as i32).into(),
            Self::U32 => (whole as u32).into(),
            Self::F32 => f32::from_bits(whole as u32).into(),
            Self::F64 => f64::from_bits(whole),
        }
    }

    /// The largest number for a colour, if it is whole; of signed bytes that of unsigned ones, which they stand for.
    pub fn most(self) -> Option<f32> {
        match self {
            Self::I8 | Self::U8 => Some(255.0),
            Self::I16 => Some(32767.0),
            Self::U16 => Some(65535.0),
            Self::I32 => Some(i32::MAX as f32),
            Self::U32 => Some(u32::MAX as f32),
            Self::F32 | Self::F64 => None,
        }
    }
}

/// A column of an element: a number in each row or, with the type of its length, a list.
pub(super) struct Property {
    pub name: String,
    kind: NumberType,
    length: Option<NumberType>,
}

pub(super) struct Element {
    pub name: String,
    pub rows: usize,
    pub properties: Vec<Property>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    Text,
    Little,
    Big,
}

/// The content of a header.
pub(super) struct Header {
    order: Order,
    pub elements: Vec<Element>,
    /// The images that comments name.
    pub images: Vec<String>,
}

/// Reads the header of a file; what follows it are the rows. Names are of any encoding, lines end as on any system.
pub(super) fn header(bytes: &[u8]) -> Result<(Header, &[u8]), Wrong> {
    let mut rest = text::unmarked(bytes);
    let is_end = |byte: &u8| matches!(byte, b'\n' | b'\r');
    let first = rest.iter().position(is_end).unwrap_or(0);
    let is_mac = rest[first..].first() == Some(&b'\r') && rest.get(first + 1) != Some(&b'\n');
    let line_end = if is_mac { b'\r' } else { b'\n' };
    let mut header = Header { order: Order::Text, elements: Vec::new(), images: Vec::new() };
    for number in 1.. {
        let end = rest.iter().position(|byte| *byte == line_end).unwrap_or(rest.len());
        let line = text::decoded(&rest[..end]);
        let wrong = || (format!("malformed PLY header, line {number}: {:?}", text::name(line.trim())), HEADER);
        if end == rest.len() && line.trim() != "end_header" {
            return Err(("its PLY header has no end_header".into(), HEADER));
        }
        rest = rest.get(end + 1..).unwrap_or_default();
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["end_header"] => break,
            ["format", format, _] => {
                header.order = match format {
                    "ascii" => Order::Text,
                    "binary_little_endian" => Order::Little,
                    "binary_big_endian" => Order::Big,
                    _ => return Err(wrong()),
                }
            }
            ["comment" | "obj_info", "TextureFile", ..] => {
                let name = line.split_once("TextureFile").map_or("", |(_, name)| name.trim());
                header.images.push(name.into());
            }
            [] | ["comment" | "obj_info", ..] => {}
            ["ply"] if number == 1 => {}
            ["element", name, rows] => {
                let (name, properties) = (name.to_ascii_lowercase(), Vec::new());
                header.elements.push(Element { name, rows: rows.parse().map_err(|_| wrong())?, properties });
            }
            ["property", ref kind @ .., name] => {
                let (length, kind) = match kind {
                    ["list", length, kind] => (Some(NumberType::of(length)?), NumberType::of(kind)?),
                    [kind] => (None, NumberType::of(kind)?),
                    _ => return Err(wrong()),
                };
                let element = header.elements.last_mut().ok_or_else(wrong)?;
                element.properties.push(Property { name: name.to_ascii_lowercase(), kind, length });
            }
            _ => return Err(wrong()),
        }
    }
    Ok((header, rest))
}

/// Where the value of a column goes.
#[derive(Clone, Copy)]
enum Column {
    Nowhere,
    /// An index into [`Row::values`].
    Value(usize),
    /// An index into [`Row::lists`].
    List(usize),
}

/// The most names that a table chooses from.
pub(super) const VALUES: usize = 12;

/// The values of a row that are read, by their index in the list of names.
#[derive(Default)]
pub(super) struct Row {
    pub values: [f64; VALUES],
    pub lists: [Vec<f64>; 7],
}

/// The columns of an element, and which of them are read.
pub(super) struct Table<'a> {
    element: &'a Element,
    columns: Vec<Column>,
    /// For each name the type of its column, if the element has it.
    found: [Option<NumberType>; VALUES],
}

impl<'a> Table<'a> {
    /// Chooses the columns that have one of the names; those from `lists` on are lists, the others single values.
    pub fn new(element: &'a Element, names: &[&[&str]], lists: usize) -> Self {
        let mut table =
            Self { element, columns: vec![Column::Nowhere; element.properties.len()], found: [None; VALUES] };
        for (value, names) in names.iter().enumerate() {
            let is_list = value >= lists;
            let fits = |property: &Property, name: &str| property.name == name && property.length.is_some() == is_list;
            let position = |name: &&str| element.properties.iter().position(|property| fits(property, name));
            if let Some(at) = names.iter().find_map(position) {
                table.columns[at] = if is_list { Column::List(value) } else { Column::Value(value) };
                table.found[value] = Some(element.properties[at].kind);
            }
        }
        table
    }

    /// Whether the element has a column for each of these values.
    pub fn has(&self, mut values: Range<usize>) -> bool {
        values.all(|value| self.found[value].is_some())
    }

    /// The type of a value's column.
    pub fn kind(&self, value: usize) -> Option<NumberType> {
        self.found[value]
    }

    /// The names of the columns that are not read.
    pub fn unread(&self) -> impl Iterator<Item = &str> {
        let columns = self.element.properties.iter().zip(&self.columns);
        columns.filter(|(_, column)| matches!(column, Column::Nowhere)).map(|(property, _)| property.name.as_str())
    }
}

/// The rows of a file.
pub(super) struct Body<'a> {
    rest: &'a [u8],
    order: Order,
    /// Whether each line of a text is a row, and whether a row ends with its line. Without lines, words alone count.
    has_lines: bool,
    is_exact: bool,
    /// Rows with more words than columns.
    pub longer: usize,
    /// Words that are not numbers.
    pub strange: usize,
}

impl<'a> Body<'a> {
    pub fn new(header: &Header, rest: &'a [u8]) -> Self {
        let full = header.elements.iter().filter(|element| !element.properties.is_empty());
        let rows = full.map(|element| element.rows).fold(0, usize::saturating_add);
        let is_text = header.order == Order::Text;
        let rest = if is_text { text::unpadded(rest) } else { rest };
        let lines = rest.split(|byte| matches!(byte, b'\n' | b'\r')).filter(|line| !line.trim_ascii().is_empty());
        let lines = if is_text { lines.count() } else { 0 };
        let (has_lines, is_exact) = (lines >= rows && is_text, lines == rows);
        Self { rest, order: header.order, has_lines, is_exact, longer: 0, strange: 0 }
    }

    /// The bytes behind the last row, without padding.
    pub fn left(&self) -> usize {
        text::unpadded(self.rest.trim_ascii_start()).len()
    }

    /// Reads all rows of an element.
    ///
    /// # Errors
    /// A fault in the file, or one that `take` finds.
    pub fn read(&mut self, table: &Table, take: &mut dyn FnMut(&Row) -> Result<(), Wrong>) -> Result<(), Wrong> {
        let Element { name, rows, properties } = table.element;
        // Text has at least a digit and a space for each.
        let size = |kind: NumberType| if self.order == Order::Text { 2 } else { kind.size() };
        let least: usize = properties.iter().map(|property| size(property.length.unwrap_or(property.kind))).sum();
        if least.saturating_mul(*rows) > self.rest.len() + 1 {
            let (name, bytes) = (text::name(name), self.rest.len());
            return Err((format!("cut off: it claims {rows} rows of {name:?} and holds {bytes} bytes"), AGAIN));
        }
        let mut row = Row::default();
        for number in (1..=*rows).take_while(|_| !properties.is_empty()) {
            let place = || format!("element {:?}, row {number}", text::name(name));
            self.row(table, &mut row).map_err(|wrong| crate::within(place())(wrong))?;
            take(&row)?;
        }
        Ok(())
    }

    fn row(&mut self, table: &Table, row: &mut Row) -> Result<(), Wrong> {
        let is_text = self.order == Order::Text;
        self.rest = if is_text { self.rest.trim_ascii_start() } else { self.rest };
        for (column, property) in table.columns.iter().zip(&table.element.properties) {
            let Some(length) = property.length else {
                match *column {
                    Column::Value(at) => row.values[at] = self.number(property.kind)?,
                    _ => self.skip(property.kind)?,
                }
                continue;
            };
            let length = self.number(length)?;
            if !(length >= 0.0 && length.fract() == 0.0) {
                return Err((format!("a list of {length} numbers"), AGAIN));
            }
            let list = if let Column::List(at) = *column { Some(&mut row.lists[at]) } else { None };
            match list {
                Some(list) => {
                    list.clear();
                    (0..length as u64).try_for_each(|_| self.number(property.kind).map(|x| list.push(x)))?;
                }
                None => (0..length as u64).try_for_each(|_| self.skip(property.kind))?,
            }
        }
        if self.has_lines {
            let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(self.rest.len());
            let (line, rest) = self.rest.split_at(end);
            self.longer += usize::from(!line.trim_ascii().is_empty());
            self.rest = rest;
        }
        Ok(())
    }

    /// The bytes of the next number: a word, or as many as its type has.
    fn next(&mut self, kind: NumberType) -> Result<&'a [u8], Wrong> {
        let cut = || ("the file is cut off there".to_string(), AGAIN);
        let end = match self.order {
            Order::Text => {
                let word = self.rest.trim_ascii_start();
                let gap = &self.rest[..self.rest.len() - word.len()];
                if self.is_exact && gap.iter().any(|byte| matches!(byte, b'\n' | b'\r')) {
                    return Err(("it has fewer numbers than the header names".into(), HEADER));
                }
                self.rest = word;
                word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len())
            }
            _ => kind.size(),
        };
        let (bytes, rest) = self.rest.split_at_checked(end).filter(|(bytes, _)| !bytes.is_empty()).ok_or_else(cut)?;
        self.rest = rest;
        Ok(bytes)
    }

    fn skip(&mut self, kind: NumberType) -> Result<(), Wrong> {
        self.next(kind).map(drop)
    }

    fn number(&mut self, kind: NumberType) -> Result<f64, Wrong> {
        let bytes = self.next(kind)?;
        if self.order == Order::Text {
            let number = text::number(&text::decoded(bytes));
            self.strange += usize::from(number.is_none());
            return Ok(number.unwrap_or(f64::NAN));
        }
        let mut padded = [0; 8];
        padded[..bytes.len()].copy_from_slice(bytes);
        if self.order == Order::Big {
            padded[..bytes.len()].reverse();
        }
        Ok(kind.value(padded))
    }
}
