//! The diagnosis as one page that opens anywhere: no network, no script; light, dark and paper.
//!
//! | file | problem |
//! |---|---|
//! | `page.html` | frame and style |
//! | `sections.rs` | the answer in words, bars and tables |
//! | `overlay.rs` | real, simulated and corrected over time; the gap on the path |
//! | `behaviour.rs` | understeer, yaw gain, command and angle, frequency response |
//! | `frequency.rs` | that response |
//! | `tuning.rs` | the page of `rfl tune`, in the same frame |
//! | `view.rs` | the diagnosis as plots look at it |
//! | `plot.rs` | plots as SVG |
//! | `html.rs` | text, numbers, tables |

mod behaviour;
mod frequency;
mod html;
mod overlay;
mod plot;
mod sections;
mod tuning;
mod view;

use html::{contents, escaped, section};
use view::View;

pub use tuning::{Answer, AtSpeed, Tuned, tuning_page};
pub use view::PageInput;

/// The page.
#[must_use]
pub fn page(input: &PageInput) -> String {
    let view = View::new(input);
    let behaviour =
        [behaviour::understeer(&view), behaviour::yaw_gain(&view), behaviour::command_loop(&view)].concat();
    let behaviour =
        if behaviour.is_empty() { String::new() } else { format!("<div class='pair'>{behaviour}</div>") };
    let sections = [
        ("How probable", sections::posterior(view.report)),
        ("How far the gap shrinks", sections::gap_reduction(view.report)),
        ("Where it lies", sections::stages(view.report) + &sections::places(view.report)),
        ("On the path", overlay::on_path(&view)),
        ("Real, simulated, corrected", overlay::signals(&view)),
        ("Answer to steering", behaviour + &behaviour::frequency(&view)),
        ("What to drive next", sections::manoeuvre(view.report)),
        ("All candidates", sections::candidates(view.report)),
        ("What this log can show", sections::observability(view.report)),
        ("The calibrated simulator", sections::recalibration(view.report, input.files)),
        ("The log", sections::findings(view.report)),
        ("Made from", sections::inputs(view.report)),
    ];
    let all: String = sections.iter().map(|(title, body)| section(title, body)).collect();
    let body = [sections::verdict(view.report), contents(&sections), all].concat();
    let title = format!("Diagnosis: {}", sections::headline(&view.report.verdict));
    include_str!("page.html").replace("{{title}}", &escaped(&title)).replace("{{body}}", &body)
}
