//! How quantities are written wherever people read them.

/// Digits in groups of three, `1,234`.
pub(crate) fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut grouped = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(digit);
    }
    grouped
}

/// A number with its noun: `1 step`, `1,234 steps`.
pub(crate) fn counted(number: usize, noun: &str) -> String {
    let ending = if number == 1 { "" } else { "s" };
    format!("{} {noun}{ending}", grouped(number))
}

/// A number, or that it is too great to be told.
pub(crate) fn number_or_many(number: Option<u64>) -> String {
    number.map_or_else(|| "very many".to_owned(), |number| number.to_string())
}

/// A number with its noun, or that it is too great to be told.
pub(crate) fn counted_or_many(number: Option<u64>, noun: &str) -> String {
    match number.map(usize::try_from) {
        Some(number) => counted(number.unwrap_or(usize::MAX), noun),
        None => format!("{} {noun}s", number_or_many(None)),
    }
}

/// Names with commas, of a long list the first so many and how many more there are: `a, b and 3 more`.
pub(crate) fn listed(names: impl IntoIterator<Item: AsRef<str>>, most: usize) -> String {
    let mut names = names.into_iter();
    let first = names.by_ref().take(most);
    let first: Vec<String> = first.map(|name| name.as_ref().to_owned()).collect();
    match names.count() {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_long_list_the_first_are_named() {
        assert_eq!(listed([""; 0], 2), "");
        assert_eq!(listed(["a", "b"], 2), "a, b");
        assert_eq!(listed(["a", "b", "c", "d"], 2), "a, b and 2 more");
    }

    #[test]
    fn numbers_are_grouped_by_thousands() {
        let told = [0, 999, 1_000, 1_234_567].map(grouped);
        assert_eq!(told, ["0", "999", "1,000", "1,234,567"]);
    }

    #[test]
    fn one_is_singular_and_nothing_else() {
        let told = [0, 1, 2].map(|count| counted(count, "episode"));
        assert_eq!(told, ["0 episodes", "1 episode", "2 episodes"]);
    }
}
