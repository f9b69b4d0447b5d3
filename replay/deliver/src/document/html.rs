//! A document as one HTML file, which prints on A4.

use core::fmt::Write as _;

use super::model::{Block, Document, Table};

const STYLE: &str = "\
@page { size: A4; margin: 20mm 20mm 22mm; }
* { box-sizing: border-box; }
body { max-width: 170mm; margin: 0 auto; padding: 8mm 0; color: #000; background: #fff;
  font: 10pt/1.4 Helvetica, Arial, 'Liberation Sans', sans-serif; }
h1 { font-size: 24pt; line-height: 1.2; margin: 35mm 0 10mm; }
h2 { font-size: 14pt; margin: 10mm 0 3mm; break-after: avoid; }
h3 { font-size: 11pt; margin: 5mm 0 2mm; break-after: avoid; }
p { margin: 0 0 2.5mm; }
ul { margin: 0 0 3mm; padding-left: 5mm; }
.warning { border: 1pt solid #000; padding: 2mm 3mm; font-weight: bold; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 1mm 6mm; margin: 0 0 4mm; }
dt { color: #444; }
dd { margin: 0; overflow-wrap: anywhere; }
table { border-collapse: collapse; margin: 0 0 4mm; font-size: 8.5pt; font-variant-numeric: tabular-nums; }
thead { display: table-header-group; }
tr { break-inside: avoid; }
th, td { padding: 1mm 4mm 1mm 0; text-align: left; vertical-align: top; border-bottom: .4pt solid #999; }
th.number, td.number { text-align: right; }
th { border-bottom: .8pt solid #000; vertical-align: bottom; }
figure { margin: 2mm 0 5mm; break-inside: avoid; }
svg { display: block; width: 100%; height: auto; font-family: inherit; }
figcaption { font-size: 8.5pt; color: #333; margin-top: 1mm; }
.page { break-after: page; }
@media print { body { max-width: none; padding: 0; } }
@media screen { .page { border-bottom: 1pt solid #999; margin: 10mm 0; } }
";

/// Returns a document as one HTML file without scripts and without references to other files.
pub fn html(document: &Document) -> String {
    let title = escaped(&document.title);
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en-GB\">\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n\
         <body>\n<h1>{title}</h1>\n"
    );
    for block in &document.blocks {
        append(&mut text, block);
    }
    // Writing to a String can't fail.
    let _written = write!(text, "<p>{}</p>\n</body>\n</html>\n", escaped(&document.footer));
    text
}

fn append(text: &mut String, block: &Block) {
    let written = match block {
        Block::Heading(heading) => writeln!(text, "<h2>{}</h2>", escaped(heading)),
        Block::Subheading(heading) => writeln!(text, "<h3>{}</h3>", escaped(heading)),
        Block::Paragraph(words) => writeln!(text, "<p>{}</p>", escaped(words)),
        Block::Warning(words) => writeln!(text, "<p class=\"warning\">{}</p>", escaped(words)),
        Block::List(items) => {
            let items: Vec<String> =
                items.iter().map(|item| format!("<li>{}</li>\n", escaped(item))).collect();
            writeln!(text, "<ul>\n{}</ul>", items.concat())
        }
        Block::Values(values) => {
            let pair = |(name, value): &(String, String)| {
                format!("<dt>{}</dt><dd>{}</dd>\n", escaped(name), escaped(value))
            };
            writeln!(text, "<dl>\n{}</dl>", values.iter().map(pair).collect::<String>())
        }
        Block::Table(table) => {
            let Table { columns, rows } = table;
            let numbers: Vec<bool> = (0..columns.len()).map(|column| table.is_number(column)).collect();
            let row = |cells: &Vec<String>, tag: &str| {
                let cell = |(cell, is_number): (&String, &bool)| {
                    let class = if *is_number { " class=\"number\"" } else { "" };
                    format!("<{tag}{class}>{}</{tag}>", escaped(cell))
                };
                format!("<tr>{}</tr>\n", cells.iter().zip(&numbers).map(cell).collect::<String>())
            };
            let rows: String = rows.iter().map(|cells| row(cells, "td")).collect();
            writeln!(
                text,
                "<table>\n<thead>{}</thead>\n<tbody>\n{rows}</tbody>\n</table>",
                row(columns, "th")
            )
        }
        Block::Figure(drawing, caption) => {
            let caption = escaped(caption);
            writeln!(text, "<figure>\n{}<figcaption>{caption}</figcaption>\n</figure>", drawing.svg())
        }
        Block::PageBreak => writeln!(text, "<div class=\"page\"></div>"),
    };
    debug_assert!(written.is_ok(), "a String has room");
}

fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            _ => safe.push(letter),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_a_text_is_shown_as_text() {
        let blocks = vec![Block::Values(vec![("client".to_owned(), "<b>A & B</b>".to_owned())])];
        let page = html(&Document { title: "<i>".to_owned(), footer: String::new(), blocks });
        assert!(page.contains("<dt>client</dt><dd>&lt;b&gt;A &amp; B&lt;/b&gt;</dd>"), "{page}");
        assert!(page.contains("<h1>&lt;i&gt;</h1>") && !page.contains("<script"), "{page}");
    }
}
