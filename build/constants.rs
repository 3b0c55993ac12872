//! Turns `glsl/common/constants.glsl` into Rust constants, so that both sides read one source.

/// Rust source with one `pub const` for each `const uint|int|float|bool NAME = value;` line, documented by the comment
/// above it (or behind it).
pub fn to_rust(source: &str, file: &str) -> Result<String, String> {
    let mut rust = String::new();
    let mut comment: Vec<&str> = Vec::new();
    for (number, line) in (1..).zip(source.lines()) {
        let line = line.trim();
        if let Some(text) = line.strip_prefix("//") {
            comment.push(text.trim());
            continue;
        }
        if let Some(declaration) = line.strip_prefix("const ") {
            let at = |what: &str| format!("{file}:{number}: {what}");
            let (declaration, behind) = declaration.split_once(';').ok_or(at("a constant must end on its line"))?;
            if let Some(text) = behind.trim().strip_prefix("//") {
                comment.push(text.trim());
            }
            if comment.is_empty() {
                return Err(at("a shared constant needs a `//` comment above it: it becomes the Rust documentation"));
            }
            let (left, value) = declaration.split_once('=').ok_or(at("a constant needs a value"))?;
            let ty = match left.split_whitespace().collect::<Vec<_>>()[..] {
                ["uint", name] => (name, "u32"),
                ["int", name] => (name, "i32"),
                ["float", name] => (name, "f32"),
                ["bool", name] => (name, "bool"),
                _ => return Err(at("only `const uint|int|float|bool NAME = value;` is shared")),
            };
            for text in &comment {
                rust.push_str(&format!("/// {text}\n"));
            }
            rust.push_str(&format!("pub const {}: {} = {};\n", ty.0, ty.1, expression(value)));
        }
        comment.clear();
    }
    Ok(rust)
}

/// A GLSL constant expression as Rust: number suffixes dropped, `.5` and `1.` written out; names stay.
fn expression(glsl: &str) -> String {
    let mut rust = String::new();
    let mut rest = glsl.trim();
    while let Some(first) = rest.chars().next() {
        if first.is_ascii_digit() || (first == '.' && rest[1..].starts_with(|c: char| c.is_ascii_digit())) {
            let end = number_end(rest);
            let hexadecimal = rest.starts_with("0x");
            let digits = rest[..end].trim_end_matches(['u', 'U']);
            let digits = if hexadecimal { digits } else { digits.trim_end_matches(['f', 'F']) };
            if digits.starts_with('.') {
                rust.push('0');
            }
            rust.push_str(digits);
            if digits.ends_with('.') {
                rust.push('0');
            }
            rest = &rest[end..];
        } else if first.is_alphabetic() || first == '_' {
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            rust.push_str(&rest[..end]);
            rest = &rest[end..];
        } else {
            rust.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    rust
}

/// Where the number at the start of `text` ends: digits, letters, dots, and a sign behind a decimal exponent.
fn number_end(text: &str) -> usize {
    let hexadecimal = text.starts_with("0x");
    let mut previous = ' ';
    for (at, c) in text.char_indices() {
        let exponent_sign = !hexadecimal && matches!(c, '+' | '-') && matches!(previous, 'e' | 'E');
        if !(c.is_ascii_alphanumeric() || c == '.' || exponent_sign) {
            return at;
        }
        previous = c;
    }
    text.len()
}
