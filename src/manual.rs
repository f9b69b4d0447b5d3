//! `headrace completions` and `headrace man`: describe the command line for shells and for `man`.

use std::io::Write as _;

use clap::{Command, CommandFactory as _};

use crate::cli::{Cli, Completions, Man};
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver_bytes, say};
use crate::outputs::{self, Claims, Kind};

/// Name of the program in completions and manual pages.
const NAME: &str = "headrace";

/// `headrace completions`: writes the script for a shell to stdout.
pub(crate) fn completions(args: &Completions) -> Result<u8, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), NAME, &mut script);
    deliver_bytes(&script)?;
    Ok(failure::OK)
}

/// `headrace man`: writes the program's page to stdout, or all pages into a folder.
pub(crate) fn man(args: &Man) -> Result<u8, Failure> {
    let mut command = Cli::command().name(NAME);
    command.build();
    let Some(folder) = &args.folder else {
        deliver_bytes(&page(command)?)?;
        return Ok(failure::OK);
    };
    outputs::folder(folder)?;
    let pages = pages(&command)?;
    let mut claims = Claims::reading([], &args.overwrite);
    for (name, _) in &pages {
        claims.claim("DIR", &folder.join(name), Kind::Manual)?;
    }
    for (name, page) in &pages {
        files::write(&folder.join(name), page)?;
    }
    say(&format!("{} pages in {}", pages.len(), folder.display()));
    Ok(failure::OK)
}

/// File name and content of each manual page: one for the program, and one per command.
fn pages(command: &Command) -> Result<Vec<(String, Vec<u8>)>, Failure> {
    let of_commands = command.get_subcommands().filter(|command| command.get_name() != "help").map(|sub| {
        let name = format!("{NAME}-{}.1", sub.get_name());
        Ok((name, page(sub.clone().disable_help_subcommand(true))?))
    });
    let own = page(command.clone()).map(|page| (format!("{NAME}.1"), page));
    std::iter::once(own).chain(of_commands).collect()
}

fn page(command: Command) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    let failed = |source| Failure::System { what: "making a manual page", source };
    page.write_all(outputs::MANUAL.as_bytes()).map_err(failed)?;
    clap_mangen::Man::new(command).render(&mut page).map_err(failed)?;
    Ok(page)
}
