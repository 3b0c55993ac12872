//! Reads STL files, binary and text. No crate is used: stl_io refuses solids whose names hold a keyword, normals that are not
//! numbers, and lines that end as on old Macintoshes, and drops colours.

use crate::{fault, source::Source, text, texture::linear_from_srgb, weld::Weld};
use softras::{
    Result,
    scene::{Appearance, Mesh},
};

/// The bytes before the first triangle of a binary file, and those of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

pub(super) fn read(source: &mut Source, bytes: Vec<u8>) -> Result<Mesh> {
    let path = source.path;
    let count = bytes.get(80..HEADER).map(|n| u32::from_le_bytes([n[0], n[1], n[2], n[3]]) as usize);
    let expected = count.map(|count| HEADER as u64 + TRIANGLE as u64 * count as u64);
    let length = bytes.len() as u64;
    if is_text(&bytes) && expected != Some(length) {
        return facets(source, bytes);
    }
    match (count, expected) {
        (Some(count), Some(expected)) if length < expected => {
            let holds = (length - HEADER as u64) / TRIANGLE as u64;
            let what = format!("cut off: it claims {count} triangles and holds {holds}");
            Err(fault(path, what, "copy or export the file again"))
        }
        (Some(_), Some(expected)) => {
            if length > expected {
                source.notes.add(None, format!("{} bytes after the last triangle are not read", length - expected));
            }
            binary(source, &bytes[..expected as usize])
        }
        _ => Err(fault(path, "neither a text nor a binary STL file", "export it again, as binary STL")),
    }
}

/// Whether a file is one of text: it begins with `solid`, behind comments, and has a facet, or has ended, soon thereafter.
fn is_text(bytes: &[u8]) -> bool {
    let wide = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
    let start = text::decoded(&bytes[..bytes.len().min(2048)]).to_ascii_lowercase();
    let mut start = start.trim_start_matches('\u{feff}').trim_start();
    while start.starts_with('#') {
        start = start.split_once(['\n', '\r']).map_or("", |(_, rest)| rest.trim_start());
    }
    wide || start.starts_with("solid") && ["facet", "endsolid", "end solid"].iter().any(|word| start.contains(word))
}

/// Reads the triangles of all solids of a text. Names, which may hold any word, end with their line or before `facet normal`.
fn facets(source: &mut Source, bytes: Vec<u8>) -> Result<Mesh> {
    let text = text::whole(source.path, bytes)?;
    let (text, rest) = text.split_once('\0').unwrap_or((&text, ""));
    if !rest.is_empty() {
        source.notes.add(None, format!("{} bytes after the end of the text are not read", rest.len()));
    }
    let (mut positions, mut corners, mut words) = (Vec::<[f64; 3]>::new(), 0, Vec::new());
    let line_end = if text.contains('\n') { '\n' } else { '\r' };
    for (line, number) in text.split(line_end).zip(1..) {
        words.clear();
        if !line.trim_start().starts_with('#') {
            words.extend(line.split_whitespace());
        }
        let is = |at: usize, word: &str| words.get(at).is_some_and(|own: &&str| own.eq_ignore_ascii_case(word));
        let mut at = 0;
        while let Some(word) = words.get(at) {
            at += 1;
            match word.to_ascii_lowercase().as_str() {
                "vertex" => {
                    let xyz = [at, at + 1, at + 2].map(|at| words.get(at).and_then(|word| text::number(word)));
                    if xyz.contains(&None) {
                        source.notes.count(number, "a vertex is not three numbers");
                    }
                    positions.push(xyz.map(|x| x.unwrap_or(f64::NAN)));
                    (at, corners) = (at + 3, corners + 1);
                }
                "facet" | "endfacet" | "endloop" => {
                    if !matches!(corners, 0 | 3) {
                        source.notes.count(number, "facets of other than three vertices are left out");
                        positions.truncate(positions.len() - corners);
                    }
                    corners = 0;
                }
                "normal" => at += 3,
                "solid" | "endsolid" => {
                    while at < words.len() && !(is(at, "facet") && is(at + 1, "normal")) {
                        at += 1
                    }
                }
                "outer" | "loop" | "end" => {}
                "color" => {
                    source.notes.count(number, "colours of text are not read");
                    at = words.len();
                }
                _ => source.notes.count(number, "words that STL does not have are not read"),
            }
        }
    }
    if corners % 3 != 0 {
        return Err(fault(source.path, "cut off within a facet", "copy or export the file again"));
    }
    mesh(source, &positions, Vec::new())
}

/// Reads the triangles of a binary file, with their colours: those of Materialise where the header gives a default, else those of
/// VisCAM.
fn binary(source: &mut Source, bytes: &[u8]) -> Result<Mesh> {
    let number = |bytes: &[u8]| f64::from(f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]));
    let usual = bytes[..80]
        .windows(10)
        .find(|window| window.starts_with(b"COLOR=") && window[6..] != [0; 4])
        .map(|window| [window[6], window[7], window[8]]);
    let curve = |x: f32| if source.options.srgb { linear_from_srgb(x) } else { x };
    let fifth = |word: u16, low: u16| curve(f32::from(word >> low & 31) / 31.0);
    let (mut positions, mut colors, mut is_colored) = (Vec::new(), Vec::new(), usual.is_some());
    let triangles = || bytes[HEADER..].chunks_exact(TRIANGLE);
    let word = |triangle: &[u8]| u16::from_le_bytes([triangle[48], triangle[49]]);
    // Where no word has a colour, nobody wrote colours into them.
    let has_words = triangles().any(|triangle| word(triangle) & 0x7fff != 0);
    for triangle in triangles() {
        positions.extend([12, 24, 36].map(|at| [0, 4, 8].map(|k| number(&triangle[at + k..]))));
        let word = word(triangle);
        // Materialise sets the highest bit where the object's colour counts; MeshLab reads a colour beside it all the same.
        let has_own = match usual {
            Some(_) => has_words && word & 0x8000 == 0 || !matches!(word & 0x7fff, 0 | 0x7fff),
            None => has_words && word & 0x8000 != 0,
        };
        is_colored |= has_own;
        colors.push(match usual {
            _ if has_own && usual.is_some() => [0, 5, 10].map(|low| fifth(word, low)),
            _ if has_own => [10, 5, 0].map(|low| fifth(word, low)),
            Some(usual) => usual.map(|byte| curve(f32::from(byte) / 255.0)),
            None => [1.0; 3],
        });
    }
    mesh(source, &positions, if is_colored { colors } else { Vec::new() })
}

/// The mesh of the corners of all triangles; vertices at one position become one.
fn mesh(source: &mut Source, corners: &[[f64; 3]], colors: Vec<[f32; 3]>) -> Result<Mesh> {
    let own: Vec<[u32; 3]> = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let positions = source.placed(corners, &own)?;
    let mut weld = Weld::new();
    let triangles = own.iter().map(|corners| corners.map(|c| weld.vertex(positions[c as usize], ()).0)).collect();
    let appearance = match colors.first() {
        None => Appearance::Uniform([1.0; 3]),
        Some(first) if colors.iter().all(|color| color == first) => Appearance::Uniform(*first),
        Some(_) => Appearance::Surface { resolution: 1, texels: colors },
    };
    source.mesh(weld.positions, triangles, appearance, |_| None)
}
