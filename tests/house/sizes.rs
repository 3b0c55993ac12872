//! Every source file begins with one sentence that says what it is, has at most 400 lines and no function over 60 lines.

use std::path::{Path, PathBuf};
use syn::visit::{self, Visit};

/// The folders whose files keep the rules.
const FOLDERS: [&str; 3] = ["src", "crates/softras-cli/src", "crates/softras-burn/src"];
const MOST_FILE_LINES: usize = 400;
const MOST_FUNCTION_LINES: usize = 60;

/// Every `.rs` file below a folder, sorted.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(sources(&path));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            files.push(path);
        }
    }
    files.sort();
    files
}

/// What breaks a rule in a source text, each as `name: what`.
fn violations(name: &str, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let first: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//! ")).collect();
    if !first.last().is_some_and(|line| line.ends_with(['.', '?'])) {
        found.push(format!("{name}: does not begin with a `//!` sentence that says what the file is"));
    }
    let lines = text.lines().count();
    if lines > MOST_FILE_LINES {
        found.push(format!("{name}: {lines} lines, at most {MOST_FILE_LINES} are allowed: split the file by subject"));
    }
    let mut functions = Functions { name, found };
    functions.visit_file(&syn::parse_file(text).unwrap_or_else(|error| panic!("{name}: {error}")));
    functions.found
}

/// Visits functions and keeps those that are too long.
struct Functions<'a> {
    name: &'a str,
    found: Vec<String>,
}

impl Functions<'_> {
    /// Lines from the signature to the closing brace, without attributes and doc comments.
    fn check(&mut self, signature: &syn::Signature, body: &syn::Block) {
        let (first, last) = (signature.fn_token.span.start().line, body.brace_token.span.close().end().line);
        let lines = last + 1 - first;
        if lines > MOST_FUNCTION_LINES {
            self.found.push(format!(
                "{}:{first}: function `{}` has {lines} lines, at most {MOST_FUNCTION_LINES} are allowed: split it",
                self.name, signature.ident
            ));
        }
    }
}

impl<'ast> Visit<'ast> for Functions<'_> {
    fn visit_item_fn(&mut self, function: &'ast syn::ItemFn) {
        self.check(&function.sig, &function.block);
        visit::visit_item_fn(self, function);
    }

    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        self.check(&function.sig, &function.block);
        visit::visit_impl_item_fn(self, function);
    }

    fn visit_trait_item_fn(&mut self, function: &'ast syn::TraitItemFn) {
        if let Some(body) = &function.default {
            self.check(&function.sig, body);
        }
        visit::visit_trait_item_fn(self, function);
    }
}

#[test]
fn files_and_functions_fit_a_reader() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let files: Vec<PathBuf> = FOLDERS.iter().flat_map(|folder| sources(&root.join(folder))).collect();
    assert!(files.len() > 100, "only {} files were found", files.len());
    let check = |path: &PathBuf| {
        let name = path.strip_prefix(root).unwrap_or(path).display().to_string();
        violations(&name, &std::fs::read_to_string(path).unwrap())
    };
    let found: Vec<String> = files.iter().flat_map(check).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// A text that keeps all rules: a function of so many lines in a file of so many.
fn text(sentence: &str, function_lines: usize, file_lines: usize) -> String {
    let body = "    a();\n".repeat(function_lines - 2);
    let text = format!("{sentence}\n\nimpl A {{\n/// Says.\nfn long() {{\n{body}}}\n}}\n");
    let missing = file_lines - text.lines().count();
    text + &"// More.\n".repeat(missing)
}

#[test]
fn every_violation_is_found() {
    let sentence = "//! Two lines that are\n//! one sentence.";
    assert_eq!(violations("good.rs", &text(sentence, 60, 400)), [""; 0]);
    let one = |text: String| {
        let found = violations("bad.rs", &text);
        assert_eq!(found.len(), 1, "{found:?}");
        found[0].clone()
    };
    let long = one(text(sentence, 61, 400));
    assert!(long.contains("bad.rs:6: function `long` has 61 lines"), "{long}");
    assert!(one(text(sentence, 60, 401)).contains("401 lines"));
    for silent in ["// A plain comment.", "//! Not a sentence", "use a::b;"] {
        assert!(one(text(silent, 60, 400)).contains("does not begin"), "{silent}");
    }
    // Free, nested and default functions are looked at too.
    let body = "    a();\n".repeat(59);
    for (before, after) in [("", ""), ("fn outer() {", "}"), ("trait T {", "}")] {
        let found = violations("bad.rs", &format!("//! A.\n{before}\nfn inner() {{\n{body}}}\n{after}\n"));
        assert!(found.iter().any(|f| f.contains("`inner` has 61 lines")), "{found:?}");
    }
}
