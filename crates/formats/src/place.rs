//! Where in a text an error is, and what may have been meant.

/// No name is longer.
const LONGEST_NAME_BYTES: usize = 64;

/// No message of the parser is longer, unless it quotes what is no name; characters.
const LONGEST_MESSAGE: usize = 4000;

/// Line and column, counted from one, of a byte offset.
pub fn of_offset(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before.get(line_start..).unwrap_or("").chars().count() + 1)
}

/// Line and column of a dotted key; of its table where the key itself is not written, of the start where neither is.
pub fn of_key(text: &str, wanted: &str) -> (usize, usize) {
    let mut table = String::new();
    let (mut best, mut found) = (0, (1, 1));
    for (number, line) in text.lines().enumerate() {
        let trimmed = line.trim_start();
        let column = line.chars().count() - trimmed.chars().count() + 1;
        let path = if trimmed.starts_with('[') {
            let header = trimmed.split('#').next().unwrap_or("");
            let name = header.trim_matches(|c: char| c == '[' || c == ']' || c.is_whitespace());
            name.clone_into(&mut table);
            table.clone()
        } else if let Some((key, _)) = trimmed.split_once('=').filter(|_| !trimmed.starts_with('#')) {
            let key = key.trim();
            if table.is_empty() { key.to_owned() } else { format!("{table}.{key}") }
        } else {
            continue;
        };
        let matches = wanted == path || wanted.strip_prefix(&path).is_some_and(|rest| rest.starts_with('.'));
        if matches && path.len() > best {
            (best, found) = (path.len(), (number + 1, column));
        }
    }
    found
}

/// Line and column of a key of an array of tables, in its `index`-th table; as [`of_key`] where there are not so many.
pub fn of_key_in(text: &str, table: &str, index: usize, key: &str) -> (usize, usize) {
    let is_header = |line: &str| line.split('#').next().unwrap_or("").trim() == format!("[[{table}]]");
    let wanted = format!("{table}.{key}");
    let mut headers = text.lines().enumerate().filter(|(_, line)| is_header(line));
    let Some((before, _)) = headers.nth(index) else {
        return of_key(text, &wanted);
    };
    let end = headers.next().map_or(usize::MAX, |(number, _)| number);
    let lines: Vec<&str> = text.lines().take(end).skip(before).collect();
    let (line, column) = of_key(&lines.join("\n"), &wanted);
    (before + line, column)
}

/// "; did you mean `...`?" where one of the candidates is near, else nothing.
pub fn suggestion<'a>(unknown: &str, candidates: impl Iterator<Item = &'a str>) -> String {
    // a comparison costs the product of the lengths
    if unknown.len() > LONGEST_NAME_BYTES {
        return String::new();
    }
    let near = candidates
        .map(|candidate| (strsim::damerau_levenshtein(unknown, candidate), candidate))
        .min_by_key(|(distance, _)| *distance);
    match near {
        Some((distance, candidate)) if distance <= 2 + unknown.chars().count() / 3 => {
            format!("; did you mean `{candidate}`?")
        }
        _ => String::new(),
    }
}

/// The parser's message, cut to one line, with the nearest of the names it lists.
pub fn with_suggestion(message: &str) -> String {
    let mut message = message.replace('\n', " ");
    if let Some((end, _)) = message.char_indices().nth(LONGEST_MESSAGE) {
        message.truncate(end);
        message.push_str("...");
    }
    if !message.starts_with("unknown ") {
        return message;
    }
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(unknown) = quoted.next() else { return message.clone() };
    format!("{message}{}", suggestion(unknown, quoted))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "format = 1\n\n[start]\n  point = \"A\"\n\n[[drive.waypoints]]\ntime_s = 3\n# goal = 1\n";

    #[test]
    fn keys_are_found_and_else_their_tables() {
        assert_eq!(of_key(TEXT, "format"), (1, 1));
        assert_eq!(of_key(TEXT, "start.point"), (4, 3));
        assert_eq!(of_key(TEXT, "start.rate_rad_s"), (3, 1));
        assert_eq!(of_key(TEXT, "drive.waypoints.time_s"), (7, 1));
        assert_eq!(of_key(TEXT, "goal"), (1, 1));
        assert_eq!(of_offset(TEXT, 0), (1, 1));
        assert_eq!(of_offset(TEXT, TEXT.find("point").unwrap()), (4, 3));
        assert_eq!(of_offset(TEXT, 10_000), (9, 1));
    }

    #[test]
    fn a_key_is_found_in_the_table_that_is_meant() {
        let entry = |time: &str| format!("[[drive.beliefs]] # told\n  time_s = {time}\nmass_kg = 9\n\n");
        let text =
            format!("format = 1\n{}{}[[drive.beliefs]]\nmass_kg = 1\n[goal]\ntime_s = 1\n", entry("1"), entry("2"));
        let found = |index, key| of_key_in(&text, "drive.beliefs", index, key);
        assert_eq!([found(0, "time_s"), found(1, "time_s"), found(1, "mass_kg")], [(3, 3), (7, 3), (8, 1)]);
        // left out, and a table that is not there
        assert_eq!((found(2, "time_s"), found(0, "sigma_kg")), ((10, 1), (2, 1)));
        assert_eq!(found(3, "time_s"), (3, 3));
    }

    #[test]
    fn the_nearest_name_is_suggested_if_it_is_near() {
        let message = with_suggestion("unknown field `durration_s`, expected one of `format`, `duration_s`, `seed`");
        assert!(message.ends_with("; did you mean `duration_s`?"), "{message}");
        assert_eq!(
            with_suggestion("unknown field `xyzzy`, expected `format`"),
            "unknown field `xyzzy`, expected `format`"
        );
        assert_eq!(with_suggestion("missing field `name`"), "missing field `name`");
    }
}
