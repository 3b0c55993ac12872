//! The public items of the library are those of `tests/public_items.txt`, so that a change of the public face is seen.
//!
//! `RENEW_PUBLIC_ITEMS=1 cargo test -p softras --test gate` writes the list anew.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

/// All features but shaderc, which changes nothing public and compiles for minutes.
const FEATURES: &str = "renderer";
const MOST_ITEMS: usize = 96;
const RENEW: &str = "RENEW_PUBLIC_ITEMS";

/// The library's documentation, made anew: pages of other features may lie in the folder.
fn documentation() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder");
    let folder = target.join("doc/softras");
    if folder.exists() {
        std::fs::remove_dir_all(&folder).unwrap();
    }
    let output = Command::new(env!("CARGO"))
        .args(["doc", "--quiet", "--no-deps", "-p", "softras", "--no-default-features", "--features", FEATURES])
        .arg("--target-dir")
        .arg(target)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(output.status.success(), "cargo doc failed:\n{}", String::from_utf8_lossy(&output.stderr));
    folder
}

/// The texts between a start and the next end, in order.
fn between<'a>(text: &'a str, start: &'a str, end: char) -> impl Iterator<Item = &'a str> {
    text.split(start).skip(1).filter_map(move |rest| rest.split(end).next())
}

/// The items that rustdoc's list of all items links to: kind, path and page (`struct`, `fit::ShapeFit`,
/// `fit/struct.ShapeFit.html`).
fn items(all: &str) -> Vec<(String, String, String)> {
    let one = |page: &str| {
        let (folder, file) = page.rsplit_once('/').unwrap_or(("", page));
        let (kind, name) = file.strip_suffix(".html")?.split_once('.')?;
        let path = if folder.is_empty() { name.into() } else { format!("{}::{name}", folder.replace('/', "::")) };
        Some((kind.to_string(), path, page.to_string()))
    };
    between(all, "<li><a href=\"", '"').filter_map(one).collect()
}

/// Methods, fields, variants and constants of an item by their anchors in its page; those of traits' implementations are
/// left out.
fn members(page: &str) -> Vec<(String, String)> {
    let one = |tag: &str| {
        let (kind, name) = tag.split('"').next()?.split_once('.')?;
        let known = ["method", "tymethod", "structfield", "variant", "associatedconstant", "associatedtype"];
        let of_trait = tag.contains("trait-impl");
        let heading = name.ends_with(".fields");
        (known.contains(&kind) && !of_trait && !heading).then(|| (kind.into(), name.replace(".field.", "::")))
    };
    between(page, "id=\"", '>').filter_map(one).collect()
}

/// The list, a line for each module, item and member.
fn list(documentation: &Path) -> String {
    let all = std::fs::read_to_string(documentation.join("all.html")).unwrap();
    let mut lines = BTreeSet::new();
    for (kind, path, page) in items(&all) {
        if let Some((module, _)) = path.rsplit_once("::") {
            lines.insert(format!("{module} mod"));
        }
        let text = std::fs::read_to_string(documentation.join(page)).unwrap();
        lines.extend(members(&text).into_iter().map(|(member, name)| format!("{path} {kind}, {member} {name}")));
        lines.insert(format!("{path} {kind}"));
    }
    lines.into_iter().map(|line| line + "\n").collect()
}

/// The lines that one list has and the other has not, each with its sign.
fn difference(old: &str, new: &str) -> Vec<String> {
    let [old, new] = [old, new].map(|list| list.lines().collect::<BTreeSet<_>>());
    let gone = old.difference(&new).map(|line| format!("- {line}"));
    gone.chain(new.difference(&old).map(|line| format!("+ {line}"))).collect()
}

#[test]
fn the_public_items_are_those_of_the_list() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/public_items.txt");
    let found = list(&documentation());
    assert!(found.contains("Renderer struct, method render\n"), "rustdoc's pages are not as this test reads them");
    if std::env::var_os(RENEW).is_some() {
        std::fs::write(&path, &found).unwrap();
    }
    let changes = difference(&std::fs::read_to_string(&path).unwrap_or_default(), &found);
    assert!(
        changes.is_empty(),
        "the public items are not those of {}. If they are meant to change, run `{RENEW}=1 cargo test -p softras --test gate`:\n{}",
        path.display(),
        changes.join("\n")
    );
    // Modules and items, without their members.
    let count = found.lines().filter(|line| !line.contains(", ")).count();
    assert!(count <= MOST_ITEMS, "{count} public items, at most {MOST_ITEMS}: make what users do not need pub(crate)");
}
