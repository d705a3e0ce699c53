//! What every page says of itself: its title, its style, and that nothing is loaded from anywhere.

use maud::{Markup, PreEscaped, html};

/// The `head` element of a page with this title.
pub(crate) fn metadata(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; img-src data:";
            meta name="generator" content="gpsindy";
            link rel="icon" href="data:,";
            title { (title) }
            style { (PreEscaped(include_str!("style.css"))) }
        }
    }
}
