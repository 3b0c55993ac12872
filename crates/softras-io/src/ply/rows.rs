//! The rows of a PLY file as numbers: the header says which columns are read into which values. The crate serde-ply reads
//! them; its own structures would need a name for each column that is known when softras is compiled.

use crate::text;
use serde::de::{DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_ply::{ElementDef, PlyFormat, PlyReader, PropertyType, ScalarType};
use std::{fmt, io::Cursor, ops::Range};

/// The least bytes that a row of an element takes.
pub(super) fn least_bytes(element: &ElementDef, format: PlyFormat) -> u64 {
    let size = |kind: ScalarType| match kind {
        ScalarType::I8 | ScalarType::U8 => 1,
        ScalarType::I16 | ScalarType::U16 => 2,
        ScalarType::I32 | ScalarType::U32 | ScalarType::F32 => 4,
        ScalarType::F64 => 8,
    };
    let one = |kind: &PropertyType| match kind {
        // A digit and a space.
        _ if format == PlyFormat::Ascii => 2,
        PropertyType::Scalar(kind) => size(*kind),
        PropertyType::List { count_type, .. } => size(*count_type),
    };
    element.properties.iter().map(|property| one(&property.property_type)).sum()
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
    element: &'a ElementDef,
    columns: Vec<Column>,
    /// For each name the type of its column, if the element has it.
    found: [Option<ScalarType>; VALUES],
    /// Whether rows take any bytes; others are not there to be read.
    is_empty: bool,
}

impl<'a> Table<'a> {
    pub fn new(element: &'a ElementDef, least: u64) -> Self {
        let columns = vec![Column::Nowhere; element.properties.len()];
        Self { element, columns, found: [None; VALUES], is_empty: least == 0 }
    }

    /// Chooses the columns that have one of the names; those from `lists` on are lists, the others single values.
    pub fn choose(&mut self, names: &[&[&str]], lists: usize) {
        for (value, names) in names.iter().enumerate() {
            let position = |name: &&str| self.element.properties.iter().position(|property| property.name == *name);
            let Some(at) = names.iter().find_map(position) else { continue };
            let (column, kind) = match self.element.properties[at].property_type {
                PropertyType::Scalar(kind) if value < lists => (Column::Value(value), kind),
                PropertyType::List { data_type, .. } if value >= lists => (Column::List(value), data_type),
                _ => continue,
            };
            self.columns[at] = column;
            self.found[value] = Some(kind);
        }
    }

    /// Whether the element has a column for each of these values.
    pub fn has(&self, mut values: Range<usize>) -> bool {
        values.all(|value| self.found[value].is_some())
    }

    /// The type of a value's column.
    pub fn kind(&self, value: usize) -> Option<ScalarType> {
        self.found[value]
    }

    /// Reads all rows.
    ///
    /// # Errors
    /// What is wrong with the file, or what `take` refuses.
    pub fn read(
        &self,
        mut reader: &mut PlyReader<Cursor<&[u8]>>,
        take: &mut dyn FnMut(&Row) -> Result<(), String>,
    ) -> Result<(), String> {
        MapAccess::next_value_seed(&mut reader, Rows { table: self, take })
            .map_err(|error| format!("malformed PLY, element \"{}\": {error}", text::name(&self.element.name)))
    }
}

struct Rows<'a, 'b> {
    table: &'a Table<'a>,
    take: &'b mut dyn FnMut(&Row) -> Result<(), String>,
}

impl<'de> DeserializeSeed<'de> for Rows<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Rows<'_, '_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("rows")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<(), A::Error> {
        let mut row = Row::default();
        let columns = &self.table.columns;
        while !self.table.is_empty && rows.next_element_seed(OneRow { columns, row: &mut row })?.is_some() {
            (self.take)(&row).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}

struct OneRow<'a> {
    columns: &'a [Column],
    row: &'a mut Row,
}

impl<'de> DeserializeSeed<'de> for OneRow<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de> Visitor<'de> for OneRow<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a row")
    }

    /// The columns come in the order of the header.
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        for column in self.columns {
            map.next_key::<IgnoredAny>()?;
            match *column {
                Column::Nowhere => _ = map.next_value::<IgnoredAny>()?,
                Column::Value(at) => self.row.values[at] = map.next_value()?,
                Column::List(at) => self.row.lists[at] = map.next_value()?,
            }
        }
        Ok(())
    }
}
