//! The page on the language: every example on it is composed with the shipped graphs.

use std::fs;

use super::command::{catena, path, root, text};

/// The files that `docs/language.md` shows as a whole, by name.
pub(crate) fn examples() -> Vec<(String, String)> {
    let page = fs::read_to_string(root().join("docs/language.md")).expect("the page");
    let mut examples = Vec::new();
    let mut block: Option<String> = None;
    for line in page.lines() {
        match (&mut block, line) {
            (None, "```yaml") => block = Some(String::new()),
            (Some(_), "```") => {
                let text = block.take().expect("it was begun");
                let name = text.lines().find_map(|l| l.strip_prefix("name: "));
                let name = name.unwrap_or_else(|| panic!("an example has no name:\n{text}"));
                examples.push((name.to_owned(), text));
            }
            (Some(text), line) => {
                text.push_str(line);
                text.push('\n');
            }
            (None, _) => {}
        }
    }
    assert!(block.is_none(), "the last example has no end");
    examples
}

#[test]
fn every_example_of_the_page_is_composed() {
    let folder = tempfile::tempdir().expect("a folder");
    let examples = examples();
    assert!(
        examples.len() >= 8,
        "examples have been lost: {}",
        examples.len()
    );
    for (name, yaml) in examples {
        let file = folder.path().join(format!("{name}.yaml"));
        fs::write(&file, &yaml).expect("written");
        let out = folder.path().join(&name);
        let output = catena(&["compose", path(&file), "--explain", "--out", path(&out)]);
        let said = text(&output.stderr);
        assert!(output.status.success(), "{name}:\n{yaml}\n{said}");
        assert!(!said.contains("warning"), "{name}: {said}");
        let told = text(&output.stdout);
        assert!(told.contains("the plan holds with probability"), "{told}");
        let drawn = fs::read_to_string(out.join("automaton.svg")).expect("the picture");
        assert!(drawn.contains("the stages of the plan"), "{drawn}");
    }
}

#[test]
fn keys_of_the_language_stand_on_the_page() {
    let page = fs::read_to_string(root().join("docs/language.md")).expect("the page");
    for schema in ["composition", "task"] {
        let file = root().join(format!("tasks/schema/{schema}.schema.json"));
        let schema = fs::read_to_string(file).expect("the schema");
        let schema: serde_json::Value = serde_json::from_str(&schema).expect("JSON");
        let mut open = vec![&schema];
        while let Some(value) = open.pop() {
            let keys = value.get("properties").and_then(|p| p.as_object());
            for key in keys.into_iter().flat_map(|k| k.keys()) {
                assert!(
                    page.contains(&format!("{key}`")) || page.contains(&format!("{key}:")),
                    "{key}"
                );
            }
            open.extend(value.as_object().into_iter().flat_map(|o| o.values()));
            open.extend(value.as_array().into_iter().flatten());
        }
    }
}
