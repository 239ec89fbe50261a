//! The order of the crate's files: each uses only those listed before it in `lib.rs`.

use std::fs;
use std::path::Path;

/// The files of the crate in the order of `lib.rs`.
fn listed(source: &Path) -> Vec<String> {
    let lib = fs::read_to_string(source.join("lib.rs")).expect("lib.rs");
    let names = lib.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.map(String::from).collect()
}

/// The text of a file and of those in the folder of its name.
fn text(source: &Path, name: &str) -> String {
    let mut text = fs::read_to_string(source.join(name).with_extension("rs")).expect("a listed file");
    for part in fs::read_dir(source.join(name)).into_iter().flatten() {
        text += &fs::read_to_string(part.expect("an entry").path()).expect("a part of it");
    }
    text
}

/// Names that stand after `crate::` in code; comments may name what they like.
fn used(text: &str) -> Vec<&str> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let after = code.flat_map(|line| line.split("crate::").skip(1));
    after.map(|rest| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or(rest)).collect()
}

#[test]
fn each_file_uses_only_those_listed_before_it() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let names = listed(&source);
    let mut found = 0;
    for (place, name) in names.iter().enumerate() {
        let text = text(&source, name);
        for other in used(&text) {
            assert!(names[..=place].iter().any(|earlier| earlier == other), "{name} uses crate::{other}");
            found += 1;
        }
    }
    assert!(names.len() > 15 && found > 50, "{} files, {found} uses", names.len());
}

#[test]
fn every_file_is_listed() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut names = listed(&source);
    names.push("lib".into());
    for entry in fs::read_dir(source).expect("the sources") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
        assert!(names.iter().any(|other| other == name), "{name}");
    }
}
