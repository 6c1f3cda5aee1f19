/// A number with its noun, `1 episode` or `2 episodes`.
pub(crate) fn counted(count: usize, noun: &str) -> String {
    let ending = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{ending}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular_and_nothing_else() {
        let told = [0, 1, 2].map(|count| counted(count, "episode"));
        assert_eq!(told, ["0 episodes", "1 episode", "2 episodes"]);
    }
}
