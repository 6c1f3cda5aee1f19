use serde_json::Value;

/// The values of a YAML or JSON text, as a tree.
///
/// # Errors
/// What is wrong with the text, with its line and column.
pub fn read_values(text: &str) -> Result<Value, String> {
    serde_yaml::from_str(text).map_err(|error| fault_of(&error))
}

/// What the parser of YAML says is wrong, in one line.
pub(super) fn fault_of(error: &serde_yaml::Error) -> String {
    let message = error.to_string();
    let fault = message.lines().next().unwrap_or_default();
    let fault = fault.strip_prefix("error: ").unwrap_or(fault);
    // What follows is said to whoever calls the parser.
    let end = fault
        .find(", set DuplicateKeyPolicy")
        .unwrap_or(fault.len());
    fault[..end].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn yaml_and_json_are_the_same_tree_and_faults_have_a_place() {
        let yaml = read_values("a: {b: 0.5}\nc: [1, x]\n").unwrap();
        let json = read_values(r#"{"a": {"b": 0.5}, "c": [1, "x"]}"#).unwrap();
        assert_eq!(yaml, json);
        let message = read_values("a: 1\nb: [").unwrap_err();
        assert!(
            message.contains("line") && message.lines().count() == 1,
            "{message}"
        );
        let twice = read_values("a: 1\na: 2\n").unwrap_err();
        assert!(
            twice.starts_with("line 2") && twice.ends_with("key: a"),
            "{twice}"
        );
    }
}
