//! The log of an image as text, a line a message: `decode IMAGE < LOG`.

use std::io::{Read, Write};

use anyhow::{Context, bail};
use defmt_decoder::{DecodeError, Table};

fn main() -> anyhow::Result<()> {
    let image = std::env::args_os().nth(1).context("give the image whose log this is")?;
    let elf = std::fs::read(&image).with_context(|| format!("cannot read {}", image.display()))?;
    let table = Table::parse(&elf)?.context("the image has no log strings")?;
    let mut log = Vec::new();
    std::io::stdin().read_to_end(&mut log).context("cannot read the log")?;
    let mut decoder = table.new_stream_decoder();
    decoder.received(&log);
    let mut out = std::io::stdout().lock();
    for count in 0_usize.. {
        match decoder.decode() {
            Ok(frame) => writeln!(out, "{}", frame.display_message())?,
            Err(DecodeError::UnexpectedEof) => break,
            Err(DecodeError::Malformed) => bail!("the log is not what the image's strings say, after {count} lines"),
        }
    }
    Ok(())
}
