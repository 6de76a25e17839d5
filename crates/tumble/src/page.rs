//! Results as pages: one self-contained file each that opens offline, in light and dark, on a telephone and on paper.
//!
//! Tables and charts are drawn here and need no script; the script reads values under the pointer and enlarges a part of a chart.

pub(crate) mod chart;
pub(crate) mod text;

use std::fmt::Write as _;

use crate::TumbleError;
use crate::output::OutputFolder;
use chart::{Chart, legend};
use text::escaped;

const STYLE: &str = include_str!("page/page.css");
const CHARTS: &str = include_str!("page/chart.js");
const SELF_TEST: &str = include_str!("page/self_test.js");

/// Everything before the content: nothing is loaded from anywhere, and nothing may be.
pub(crate) fn opened(title: &str) -> String {
    let mut page = String::with_capacity(1 << 20);
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\n<title>{}</title>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'\"/>\n\
         <style>\n{STYLE}</style></head>\n<body>\n<main>\n",
        escaped(title)
    );
    page
}

/// Everything after it: `data` in elements of their own, and scripts, those of the charts first.
pub(crate) fn closed(page: &mut String, data: &str, script: &str) {
    page.push_str("</main>\n");
    page.push_str(data);
    page.push_str("\n<script>\n");
    for part in [CHARTS, script, SELF_TEST] {
        page.push_str(part);
    }
    page.push_str("</script>\n</body></html>\n");
}

/// How a result is to be taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tone {
    /// It is what was asked for.
    Good,
    /// It may be wrong.
    Doubted,
    /// It is not.
    Bad,
}

impl Tone {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Doubted => "doubted",
            Self::Bad => "bad",
        }
    }
}

/// A page that is written from its top to its end.
pub(crate) struct Page(String);

impl Page {
    /// Begins with what it is, the verdict, and the story: what was asked, how it ended, how sure that is.
    pub(crate) fn new(kicker: &str, name: &str, tone: Tone, verdict: &str, story: [&str; 3]) -> Self {
        let mut page = opened(&format!("{name} – {kicker}"));
        let _ = write!(
            page,
            "<header><p class=\"kicker\">{}</p><h1>{}</h1>\n<p id=\"verdict\" class=\"verdict {}\"><b>{}</b></p>\n<p id=\"story\" class=\"story\">{}</p>\
             </header>\n",
            escaped(kicker),
            escaped(name),
            tone.class(),
            escaped(verdict),
            story.map(escaped).join(" ")
        );
        Self(page)
    }

    /// Numbers that matter, each with a note.
    pub(crate) fn tiles(&mut self, tiles: &[(&str, String, String)]) {
        self.0.push_str("<dl class=\"tiles\" id=\"numbers\">");
        for (name, value, note) in tiles {
            let _ = write!(
                self.0,
                "<div><dt>{}</dt><dd><b>{}</b><small>{}</small></dd></div>",
                escaped(name),
                escaped(value),
                escaped(note)
            );
        }
        self.0.push_str("</dl>\n");
    }

    /// Sentences that a reader must not miss.
    pub(crate) fn warnings(&mut self, warnings: &[String]) {
        for warning in warnings {
            let _ = writeln!(self.0, "<p class=\"warning\">{}</p>", escaped(warning));
        }
    }

    /// A section begins, and with it ends the one before.
    pub(crate) fn section(&mut self, id: &str, heading: &str, about: &str) {
        let (heading, about) = (escaped(heading), escaped(about));
        let _ = writeln!(self.0, "<h2 id=\"{id}\">{heading}</h2>\n<p class=\"about\">{about}</p>");
    }

    /// Charts side by side, under keys that they share.
    pub(crate) fn charts(&mut self, keys: &[(&'static str, &str)], charts: &[Chart]) {
        if !keys.is_empty() {
            let keys: Vec<_> = keys.iter().map(|(class, text)| (*class, (*text).to_owned())).collect();
            legend(&mut self.0, &keys);
        }
        self.0.push_str("<div class=\"plots\">\n");
        for chart in charts {
            chart.write(&mut self.0);
        }
        self.0.push_str("</div>\n");
    }

    /// Charts as files of their own, named by what they are called in a page.
    ///
    /// # Errors
    /// [`TumbleError`] when a file cannot be written.
    pub(crate) fn chart_files(folder: &OutputFolder, charts: &[Chart]) -> Result<(), TumbleError> {
        charts.iter().try_for_each(|chart| folder.write(&format!("{}.svg", chart.id), &chart.file()))
    }

    /// A picture that was drawn elsewhere, as markup.
    pub(crate) fn picture(&mut self, name: &str, svg: &str) {
        let name = escaped(name);
        let svg = svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{name}\" "), 1);
        let _ = writeln!(self.0, "<figure class=\"picture\" tabindex=\"0\" aria-label=\"{name}\">{svg}</figure>");
    }

    /// A drawing of the house's own style, as markup.
    pub(crate) fn drawing(&mut self, svg: &str) {
        self.0.push_str(svg);
    }

    /// Rows whose first cell names them; cells are markup.
    pub(crate) fn table(&mut self, id: &str, caption: &str, columns: &[&str], rows: &[Vec<String>]) {
        let _ =
            write!(self.0, "<div class=\"wide\" tabindex=\"0\" role=\"group\" aria-label=\"{}\">", escaped(caption));
        let _ =
            write!(self.0, "<table id=\"{id}\" class=\"numbers\"><caption>{}</caption><thead><tr>", escaped(caption));
        for column in columns {
            let _ = write!(self.0, "<th scope=\"col\">{}</th>", escaped(column));
        }
        self.0.push_str("</tr></thead><tbody>\n");
        for row in rows {
            self.0.push_str("<tr>");
            for (index, cell) in row.iter().enumerate() {
                let _ = if index == 0 {
                    write!(self.0, "<th scope=\"row\">{cell}</th>")
                } else {
                    write!(self.0, "<td>{cell}</td>")
                };
            }
            self.0.push_str("</tr>\n");
        }
        self.0.push_str("</tbody></table></div>\n");
    }

    /// Sentences in a list.
    pub(crate) fn list(&mut self, id: &str, items: &[String]) {
        let _ = write!(self.0, "<ul id=\"{id}\">");
        for item in items {
            let _ = write!(self.0, "<li>{}</li>", escaped(item));
        }
        self.0.push_str("</ul>\n");
    }

    /// Text as it stands, folded away.
    pub(crate) fn folded(&mut self, id: &str, summary: &str, text: &str) {
        let _ = writeln!(
            self.0,
            "<details id=\"{id}\"><summary>{}</summary><pre tabindex=\"0\">{}</pre></details>",
            escaped(summary),
            escaped(text)
        );
    }

    /// The whole page.
    pub(crate) fn finish(mut self) -> String {
        closed(&mut self.0, "", "");
        self.0
    }
}
