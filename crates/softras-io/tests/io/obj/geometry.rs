//! Tests of vertices, faces and polygons.

use super::*;

#[test]
fn vertices_keep_the_order_of_the_file_across_groups_and_materials() {
    let text = "v 0 0 0\nv 9 9 9\nv 1 0 0\nv 0 1 0\nv 0 0 1\n\
                o first\ng a\nf 5 4 3\no second\nusemtl x\nf 1 3 4\ng third\nf -5 -1 -2\n";
    let mesh = load_text(text).unwrap().mesh;
    assert_eq!(mesh.positions()[1], [9.0; 3], "a vertex that no face uses stays");
    assert_eq!(mesh.positions().len(), 5);
    assert_eq!(mesh.triangles(), [[4, 3, 2], [0, 2, 3], [0, 4, 3]]);
}

#[test]
fn negative_indices_count_back_from_their_own_line_and_faces_may_come_first() {
    let mesh = quiet("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 2 2 2\nf -3 -2 -1\n");
    assert_eq!(mesh.triangles(), [[0, 1, 2], [0, 1, 2], [1, 2, 3]]);
}

#[test]
fn every_way_to_write_a_text_file_reads_the_same() {
    let expected = quiet(format!("{TRIANGLE}f 1 2 3\n"));
    let wide: Vec<u8> =
        "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3".encode_utf16().flat_map(u16::to_le_bytes).collect();
    let spellings: [&[u8]; 11] = [
        &wide,
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\x1a\0\0\0",
        b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 2 3\r\n",
        b"v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 3\r",
        b"\xef\xbb\xbfv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3",
        b"\tv\t0\t0\t0\n  v 1 0 0  \nv 0 1 0\n\nf\t1\t2\t3\t",
        b"v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n2 \\\n 3\n",
        b"#comment\nv 0 0 0 # comment\nv 1 0 0 #c\nv 0 1 0\nf 1 2 3 # v 1 2 3\n###\n",
        b"o caf\xe9\nv 0e0 -0 +0\nv 1.0 0. .0\nv 0 10e-1 0\nf 1 2 3\n",
        b"v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0\nf 1// 2// 3//\n",
        b"s off\nvt 0.5\nvt 0 1 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\ng\n",
    ];
    for text in spellings {
        let loaded = load_text(text).unwrap_or_else(|e| panic!("{e}\n{}", String::from_utf8_lossy(text)));
        assert_eq!(loaded.mesh, expected, "{}", String::from_utf8_lossy(text));
    }
}

#[test]
fn polygons_are_cut_in_their_plane() {
    let quad = quiet("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
    assert_eq!(quad.triangles(), [[0, 1, 2], [0, 2, 3]]);
    // Concave at vertex 4: a fan from vertex 1 would leave the polygon.
    // Seen from either side, with its normal along +x and along -x, it is cut and its triangles keep its side.
    for (face, side) in [("f 1 2 3 4 5", 1.0), ("f 5 4 3 2 1", -1.0)] {
        let arrow = quiet(format!("v 0 0 0\nv 0 4 0\nv 0 4 4\nv 0 2 1\nv 0 0 4\n{face}\n"));
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| glam::Vec3::from(arrow.positions()[i as usize]));
            (b - a).cross(c - a).x / 2.0
        };
        assert_eq!(arrow.triangles().len(), 3);
        assert!(arrow.triangles().iter().all(|t| side * area(t) > 0.0), "{face}");
        assert_eq!(arrow.triangles().iter().map(area).sum::<f32>(), side * 10.0);
    }
    let bow_tie = load_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
    assert_eq!(bow_tie.mesh.triangles().len(), 2);
    assert_note(&bow_tie.notes, &[":5: ", "cross themselves"]);
}

#[test]
fn degenerate_triangles_stay() {
    let mesh = quiet(format!("{TRIANGLE}v 2 0 0\nf 1 1 2\nf 1 2 4\n"));
    assert_eq!(mesh.triangles(), [[0, 0, 1], [0, 1, 3]]);
}

#[test]
fn vertex_colours_belong_to_their_vertices() {
    let mesh = quiet("v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 0.25\nf 3 2 1\n");
    let expected = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.25]];
    assert_eq!(mesh.appearance(), &Appearance::VertexColors(expected));
    // A vertex without a colour keeps the colours of the others at their vertices.
    let partly = load_text("v 0 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n").unwrap();
    let expected = vec![[1.0; 3], [1.0; 3], [0.0, 0.0, 1.0]];
    assert_eq!(partly.mesh.appearance(), &Appearance::VertexColors(expected));
    assert_note(&partly.notes, &[":1 and 1 more: ", "white"]);
}

#[test]
fn a_fourth_coordinate_divides() {
    let loaded = load_text("v 0 0 0\nv 2 4 6 2\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert_eq!(loaded.mesh.positions()[1], [1.0, 2.0, 3.0]);
    assert_note(&loaded.notes, &[":2: ", "w divides"]);
}

#[test]
fn what_is_not_drawn_is_noted_once() {
    let text = format!(
        "{TRIANGLE}vn 0 0 1\nvn 0 1 0\nvt 0 0\nl 1 2\np 1\ncurv 0 1 1 2\nwobble 3\nf 1//1 2//1 3//2\nf 1/1/9 2/1/9 3/1/9\n"
    );
    let notes = load_text(text).unwrap().notes;
    assert_eq!(notes.len(), 5, "{notes:#?}");
    assert_note(&notes, &[":7: ", "lines"]);
    assert_note(&notes, &[":8: ", "points"]);
    assert_note(&notes, &[":9: ", "free-form"]);
    assert_note(&notes, &[":10: ", "wobble"]);
    assert_note(&notes, &[":12 and 2 more: ", "normals that the file lacks"]);
}

#[test]
fn normals_stay_with_their_corners() {
    let quad = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nvn 0 2 0\nvn 1 nan 0\n";
    let loaded = load_text(format!("{quad}f 1 2\nf 1//1 2//2 3//-3\nf 1//3 3//9 4\n")).unwrap();
    let (z, y, none) = ([0.0, 0.0, 1.0], [0.0, 2.0, 0.0], [0.0; 3]);
    assert_eq!(loaded.normals, [[z, y, z], [none; 3]]);
    assert_note(&loaded.notes, &[":7: ", "normals"]);
    assert!(load_text(format!("{TRIANGLE}f 1 2 3\n")).unwrap().normals.is_empty());
    // A polygon's triangles keep the normals of its corners.
    let loaded = load_text(format!("{quad}f 1//1 2//2 3//1 4//2\n")).unwrap();
    let expected = |i: u32| if i.is_multiple_of(2) { z } else { y };
    assert_eq!(loaded.normals, loaded.mesh.triangles().iter().map(|t| t.map(expected)).collect::<Vec<_>>());
}
