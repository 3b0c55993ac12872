//! Catalogues of Sweet Home 3D furniture: which piece is a chair, a table, a cabinet or a sofa, and where its model lies.

use std::collections::HashMap;
use std::path::{Component, Path};

/// The classes, and the words of English names that tell them.
pub const CLASSES: [(&str, &[&str]); 4] = [
    ("cabinet", &["bookcase", "cabinet", "cupboard", "dresser", "shelves", "wardrobe"]),
    ("chair", &["armchair", "chair", "stool"]),
    ("sofa", &["couch", "sofa"]),
    ("table", &["desk", "table"]),
];
/// Words of names of other things: a table fan, a desk lamp, a bat for table tennis.
const OTHERS: [&str; 5] = ["bat", "fan", "lamp", "ottoman", "tennis"];

/// A piece of furniture.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Its class, as an index into [`CLASSES`].
    pub class: usize,
    /// Its name in the catalogue that no other piece has.
    pub id: String,
    /// The path of its OBJ file in the archive.
    pub model: String,
    /// Its size in centimetres: width, height and depth.
    pub size: [f64; 3],
    /// The rows of the rotation of its model, after which y is up.
    pub rotation: [f64; 9],
}

/// The pieces of the known classes in the text of a catalogue, in its order; what is not as expected is left out.
pub fn pieces(text: &str) -> Vec<Piece> {
    let fields: HashMap<&str, &str> = text.lines().filter_map(|line| line.split_once('=')).collect();
    let field = |key: &str, number: &str| fields.get(format!("{key}#{number}").as_str()).map(|value| value.trim());
    let numbers = text.lines().filter_map(|line| line.strip_prefix("name#")?.split_once('='));
    let is_inside = |model: &str| Path::new(model).components().all(|part| matches!(part, Component::Normal(_)));
    numbers
        .filter_map(|(number, name)| {
            let side = |key| field(key, number)?.parse().ok().filter(|x: &f64| x.is_finite() && *x > 0.0);
            Some(Piece {
                class: class_of(name)?,
                id: field("id", number)?.into(),
                model: field("model", number)?.trim_start_matches('/').into(),
                size: [side("width")?, side("height")?, side("depth")?],
                rotation: field("modelRotation", number).map_or(Some(IDENTITY), rotation)?,
            })
        })
        .filter(|piece| is_inside(&piece.model))
        .collect()
}

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

fn rotation(text: &str) -> Option<[f64; 9]> {
    let numbers: Vec<f64> = text.split_whitespace().map(|x| x.parse().ok()).collect::<Option<_>>()?;
    numbers.try_into().ok().filter(|rows: &[f64; 9]| rows.iter().all(|x| x.abs() <= 1.0))
}

fn class_of(name: &str) -> Option<usize> {
    let words: Vec<String> = name.split_whitespace().map(str::to_lowercase).collect();
    let has = |known: &[&str]| words.iter().any(|word| known.contains(&word.as_str()));
    CLASSES.iter().position(|(_, known)| has(known)).filter(|_| !has(&OTHERS))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_those_of_known_names() {
        let text = "id=all\nname=Catalogue\n\
            id#1=a#oak\nname#1=Oak chair\nmodel#1=/a/oak/oak.obj\nwidth#1=40\ndepth#1=50.5\nheight#1=90\n\
            modelRotation#1=0 0 -1 0 1 0 1 0 0\n\
            id#12=a#fan\nname#12=Table fan\nmodel#12=/a/fan.obj\nwidth#12=40\ndepth#12=50\nheight#12=90\n\
            id#2=a#low\nname#2=Table\nmodel#2=low.obj\nwidth#2=100\ndepth#2=50\nheight#2=40\n\
            id#3=a#flat\nname#3=Sofa\nmodel#3=flat.obj\nwidth#3=0\ndepth#3=NaN\nheight#3=40\n\
            id#4=a#turned\nname#4=Sofa\nmodel#4=b.obj\nwidth#4=1\ndepth#4=1\nheight#4=1\nmodelRotation#4=1 0 x\n\
            id#5=a#outside\nname#5=Sofa\nmodel#5=/../b.obj\nwidth#5=1\ndepth#5=1\nheight#5=1\n";
        let rotation = [0.0, 0.0, -1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0];
        let chair =
            Piece { class: 1, id: "a#oak".into(), model: "a/oak/oak.obj".into(), size: [40.0, 90.0, 50.5], rotation };
        let size = [100.0, 40.0, 50.0];
        let table = Piece { class: 3, id: "a#low".into(), model: "low.obj".into(), size, rotation: IDENTITY };
        assert_eq!(pieces(text), [chair, table]);
    }
}
