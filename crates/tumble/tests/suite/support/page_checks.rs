//! What a report must be as a file, found by reading it.

use std::collections::BTreeSet;
use std::path::Path;
use tumble::mission_report::record_of;

/// A check: its name, and what it finds.
type Check = (&'static str, fn(&str) -> Vec<String>);

pub const CHECKS: [Check; 8] = [
    ("outside", outside),
    ("policy", policy),
    ("ids", ids),
    ("tags", tags),
    ("plot", plots),
    ("accessible", accessible),
    ("script", scripts),
    ("record", records),
];

/// All that is wrong with a page that is no mission's: what is asked of every page, its three sentences, and charts that show something.
pub fn findings_of_any(page: &str) -> Vec<String> {
    let of_missions = ["plot", "record"];
    let all = CHECKS.iter().filter(|(name, _)| !of_missions.contains(name));
    let mut found: Vec<String> =
        all.flat_map(|(name, check)| check(page).into_iter().map(move |found| format!("{name}: {found}"))).collect();
    let story =
        page.split("id=\"story\" class=\"story\">").nth(1).and_then(|rest| rest.split("</p>").next()).unwrap_or("");
    if story.matches(['.', '!']).count() < 3 || story.len() < 120 {
        found.push(format!("story: `{story}`"));
    }
    for figure in page.split("<figure class=\"plot\" ").skip(1) {
        let figure = figure.split("</figure>").next().unwrap_or("");
        if !figure.contains("class=\"line c0\"") || figure.contains("NaN") || figure.contains("inf") {
            found.push(format!("chart: {}", figure.chars().take(60).collect::<String>()));
        }
    }
    if page.len() > 1_500_000 {
        found.push(format!("size: {} bytes", page.len()));
    }
    found
}

/// All that is wrong with a page.
pub fn findings(page: &str) -> Vec<String> {
    CHECKS
        .iter()
        .flat_map(|(name, check)| check(page).into_iter().map(move |found| format!("{name}: {found}")))
        .collect()
}

/// The page without what the record wrote as data: text there is no reference.
fn without_record(page: &str) -> String {
    let opening = "id=\"mission-record\">";
    match page.split_once(opening) {
        Some((before, rest)) => {
            format!("{before}{opening}{}", rest.split_once("</script>").map_or("", |(_, after)| after))
        }
        None => page.to_owned(),
    }
}

/// An element as it begins: its name and what is written after that; and the text before it.
struct Tag<'a> {
    name: &'a str,
    attributes: Vec<(&'a str, &'a str)>,
    is_closing: bool,
    is_empty: bool,
    text_before: &'a str,
}

/// The tags of a page, strictly: quoted attributes, no bare `<`. The contents of `script` and `style` are one text.
fn parse(page: &str) -> Result<Vec<Tag<'_>>, String> {
    let mut tags = Vec::new();
    let mut rest = page;
    let mut raw: Option<String> = None;
    loop {
        let found = raw.as_ref().map_or_else(|| rest.find('<'), |name| rest.find(&format!("</{name}>")));
        let Some(start) = found else { break };
        raw = None;
        let (text_before, from) = rest.split_at(start);
        let mut end = None;
        let mut quote = false;
        for (at, byte) in from.bytes().enumerate().skip(1) {
            match byte {
                b'"' => quote = !quote,
                b'>' if !quote => {
                    end = Some(at);
                    break;
                }
                b'<' if !quote => break,
                _ => {}
            }
        }
        let shown: String = from.chars().take(40).collect();
        let end = end.ok_or(format!("a tag does not end: {shown}"))?;
        let inner = &from[1..end];
        rest = &from[end + 1..];
        let (is_closing, inner) = inner.strip_prefix('/').map_or((false, inner), |name| (true, name));
        let (is_empty, inner) = inner.strip_suffix('/').map_or((false, inner), |body| (true, body));
        let (name, mut body) = inner.split_once(char::is_whitespace).unwrap_or((inner, ""));
        let is_name =
            |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b':');
        if name == "!DOCTYPE" {
            continue;
        }
        if !is_name(name) {
            return Err(format!("no tag: {shown}"));
        }
        let mut attributes = Vec::new();
        body = body.trim_start();
        while !body.is_empty() {
            let (key, after) = body.split_once("=\"").ok_or(format!("an attribute without quotes: {shown}"))?;
            let (value, after) = after.split_once('"').ok_or(format!("an open quote: {shown}"))?;
            if !is_name(key) || value.contains('<') {
                return Err(format!("a strange attribute: {shown}"));
            }
            attributes.push((key, value));
            body = after.trim_start();
        }
        if !is_closing && !is_empty && (name == "script" || name == "style") {
            raw = Some(name.to_owned());
        }
        tags.push(Tag { name, attributes, is_closing, is_empty, text_before });
    }
    Ok(tags)
}

fn attribute<'a>(tag: &Tag<'a>, name: &str) -> Option<&'a str> {
    tag.attributes.iter().find(|(key, _)| *key == name).map(|(_, value)| *value)
}

fn outside(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    let text = without_record(page).replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
    for bad in [
        "://",
        "url(",
        "@import",
        "fetch(",
        "import(",
        "importScripts",
        "XMLHttpRequest",
        "WebSocket",
        "EventSource",
        "sendBeacon",
        "//www.",
    ] {
        if text.contains(bad) {
            found.push(format!("`{bad}`"));
        }
    }
    // A comment may say what it likes, as long as it names no place.
    let names_a_place = |line: &str| {
        line.split("//").skip(1).any(|rest| {
            rest.split([' ', '/', '\'', '"']).next().is_some_and(|host| host.contains('.') && !host.ends_with('.'))
        })
    };
    found.extend(text.lines().filter(|line| names_a_place(line)).map(|line| line.chars().take(80).collect()));
    for tag in parse(page).unwrap_or_default() {
        for (key, _) in &tag.attributes {
            if [
                "src",
                "href",
                "xlink:href",
                "srcset",
                "action",
                "formaction",
                "data",
                "poster",
                "background",
                "manifest",
                "ping",
            ]
            .contains(key)
            {
                found.push(format!("{key} of {}", tag.name));
            }
        }
        if ["iframe", "object", "embed", "link", "base", "img", "audio", "video", "image", "use", "form", "frame"]
            .contains(&tag.name)
        {
            found.push(tag.name.to_owned());
        }
    }
    found
}

fn policy(page: &str) -> Vec<String> {
    let is_closed = page.contains("http-equiv=\"Content-Security-Policy\" content=\"default-src 'none';");
    if is_closed { Vec::new() } else { vec!["the page may load".into()] }
}

fn ids(page: &str) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let tags = parse(page).unwrap_or_default();
    let twice = tags
        .iter()
        .filter_map(|tag| attribute(tag, "id"))
        .filter(|id| !seen.insert(*id))
        .map(|id| format!("`{id}` twice"));
    let mut found: Vec<String> = twice.collect();
    for tag in &tags {
        for key in ["aria-labelledby", "aria-describedby", "for"] {
            if let Some(id) = attribute(tag, key).filter(|id| !seen.contains(id)) {
                found.push(format!("`{id}` is nowhere"));
            }
        }
    }
    found
}

fn tags(page: &str) -> Vec<String> {
    let tags = match parse(page) {
        Ok(tags) => tags,
        Err(reason) => return vec![reason],
    };
    let mut open: Vec<&str> = Vec::new();
    let mut found = Vec::new();
    for tag in &tags {
        let is_raw = open.last().is_some_and(|name| ["script", "style"].contains(name));
        if !is_raw {
            for part in tag.text_before.split('&').skip(1) {
                let entity = part.split(';').next().unwrap_or("");
                if !part.contains(';')
                    || entity.is_empty()
                    || !entity.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'#')
                {
                    found.push(format!("a bare & before `{}`", part.chars().take(20).collect::<String>()));
                }
            }
        }
        if tag.is_closing {
            if open.pop() != Some(tag.name) {
                found.push(format!("</{}> closes nothing", tag.name));
                break;
            }
        } else if !tag.is_empty {
            open.push(tag.name);
        }
    }
    if found.is_empty() && !open.is_empty() {
        found.push(format!("{open:?} stay open"));
    }
    found
}

/// Every plot of the page, each with a curve.
fn plots(page: &str) -> Vec<String> {
    let mut wanted: Vec<String> = (0..10).map(|index| format!("plot-estimate-{index}")).collect();
    for name in [
        "information-mass",
        "information-com",
        "information-principal",
        "information-products",
        "weights",
        "consistency",
        "error-x",
        "error-y",
        "error-z",
        "distance",
        "angle",
        "localization",
        "force-x",
        "force-y",
        "force-z",
        "torque-x",
        "torque-y",
        "torque-z",
        "clearance",
        "speed",
        "beliefs",
    ] {
        wanted.push(format!("plot-{name}"));
    }
    let figure = |name: &str| {
        page.split(&format!("<figure class=\"plot\" id=\"{name}\">"))
            .nth(1)
            .and_then(|rest| rest.split("</figure>").next())
    };
    let mut found = Vec::new();
    for name in &wanted {
        match figure(name) {
            None => found.push(format!("no `{name}`")),
            Some(text)
                if !text.contains("<figcaption>")
                    || !text.contains("class=\"line") && !page.contains("\"t_s\":[],\"position_m\"") =>
            {
                found.push(format!("`{name}` shows nothing"));
            }
            Some(_) => {}
        }
    }
    for part in [
        "id=\"view\"",
        "id=\"time\"",
        "id=\"play\"",
        "id=\"strip\"",
        "id=\"verdict\"",
        "id=\"options\"",
        "id=\"numbers\"",
        "id=\"table-parameters\"",
        "id=\"scenario\"",
    ] {
        if !page.contains(part) {
            found.push(format!("no {part}"));
        }
    }
    found
}

fn accessible(page: &str) -> Vec<String> {
    let mut found = Vec::new();
    if !page.contains("<html lang=") {
        found.push("no language".into());
    }
    let tags = parse(page).unwrap_or_default();
    let mut depth = 0;
    for (index, tag) in tags.iter().enumerate() {
        let next = tags.get(index + 1);
        if tag.is_closing {
            depth -= i32::from(tag.name == "svg");
            continue;
        }
        match tag.name {
            "svg" => {
                if depth == 0 && attribute(tag, "aria-label").is_none() && attribute(tag, "aria-hidden").is_none() {
                    found.push("a picture without words".into());
                }
                depth += i32::from(!tag.is_empty);
            }
            "button" if next.is_none_or(|next| next.text_before.trim().is_empty()) => {
                found.push("a button without words".into());
            }
            "canvas" if attribute(tag, "aria-label").is_none() || attribute(tag, "tabindex").is_none() => {
                found.push("a canvas without words".into());
            }
            "table" => {
                let end =
                    tags.iter().skip(index).position(|other| other.name == "table" && other.is_closing).unwrap_or(0);
                let inner: Vec<&Tag<'_>> = tags.iter().skip(index).take(end).collect();
                if !inner.iter().any(|cell| cell.name == "th" && attribute(cell, "scope") == Some("col"))
                    || !inner.iter().any(|cell| cell.name == "caption")
                {
                    found.push("a table without headers".into());
                }
            }
            _ => {}
        }
    }
    found
}

fn scripts(page: &str) -> Vec<String> {
    let text = without_record(page);
    let mut found: Vec<String> =
        ["eval(", "new Function", "innerHTML", "outerHTML", "document.write", "insertAdjacentHTML", "javascript:"]
            .into_iter()
            .filter(|bad| text.contains(bad))
            .map(|bad| format!("`{bad}`"))
            .collect();
    for tag in parse(page).unwrap_or_default() {
        found.extend(
            tag.attributes
                .iter()
                .filter(|(key, _)| key.starts_with("on"))
                .map(|(key, _)| format!("{key} of {}", tag.name)),
        );
    }
    found
}

fn records(page: &str) -> Vec<String> {
    record_of(page, Path::new("report.html")).err().map(|error| error.to_string()).into_iter().collect()
}
