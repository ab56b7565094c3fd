//! A job for many machines: a template of Open Job Description, which farm managers and `openjd` run.
//!
//! ```text
//! rubor job -o shot.yaml --> shot.yaml  template: step Render, a task for each chunk; step Gather after all of them
//!                        +-> shot.json  the job
//! task   rubor render --job shot.json --frames 11-20 --resume -o OUT/chunks/11-20
//! gather rubor gather --job shot.json OUT/chunks -o OUT
//! ```
//!
//! Every frame has the same bytes in any chunk ([`crate::plan`]), a task that is run again keeps what it has, and a task
//! that is cancelled (SIGTERM) finishes its frame. Source: "2023-09 Template Schemas" of the Open Job Description
//! specifications (github.com/OpenJobDescription/openjd-specifications).

use std::fmt::Write;
use std::path::Path;

use crate::error::{Failure, Outcome};
use crate::inputs::LoadedHead;
use crate::job::{FrameList, Job};
use crate::output;
use crate::plan::Plan;

/// Frames of a task where none are said.
const CHUNK: u32 = 10;
/// Most values of a task parameter (2023-09 Template Schemas, 3.4.1.1).
const MOST_TASKS: usize = 1024;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Frames of the job.
    pub frames: usize,
    /// Tasks that draw them.
    pub tasks: usize,
}

/// Writes a template to `path` and the job beside it.
///
/// # Errors
/// The job cannot be drawn; more tasks than a template may have; a name that ends in .json; files that cannot be written.
pub fn write(job: &Job, heads: &[LoadedHead], chunk: Option<u32>, path: &Path) -> Outcome<Written> {
    let job_path = path.with_extension("json");
    let name = job_path.file_name().filter(|_| job_path != path).map(|n| n.to_string_lossy().into_owned());
    let Some(name) = name else {
        let found = format!("{}: found a name that ends in .json, which is that of the job", path.display());
        return Err(Failure::input(format!("{found}, expected .yaml")));
    };
    let plan = Plan::new(job, heads)?;
    let frames = plan.frames();
    let least = frames.len().div_ceil(MOST_TASKS);
    let chunk = match chunk {
        None => least.max(CHUNK as usize),
        Some(chunk) if (chunk as usize) < least => {
            let found = format!(
                "--chunk: found {chunk}, which makes {} tasks",
                frames.len().div_ceil(chunk as usize)
            );
            return Err(Failure::input(format!(
                "{found}, expected at least {least} (at most {MOST_TASKS} tasks)"
            )));
        }
        Some(chunk) => chunk as usize,
    };
    let lists = frames.chunks(chunk).filter_map(|c| FrameList::new(c.iter().map(|f| f + 1)));
    let lists: Vec<String> = lists.map(|list| list.to_string()).collect();
    let title = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    job.write(&job_path)?;
    output::write(path, template(&title, &name, &lists)?.as_bytes())?;
    Ok(Written { frames: frames.len(), tasks: lists.len() })
}

/// Strings of JSON are strings of YAML.
fn quoted(text: &str) -> Outcome<String> {
    serde_json::to_string(text).map_err(Failure::job)
}

fn template(title: &str, job_file: &str, chunks: &[String]) -> Outcome<String> {
    // Names of jobs have 1 to 128 characters, none of them a control; braces would be an expression.
    let title: String = title.chars().filter(|c| !c.is_control() && !"{}".contains(*c)).take(100).collect();
    let name = quoted(format!("rubor {title}").trim())?;
    let mut range = String::new();
    for chunk in chunks {
        let _ = writeln!(range, "            - {}", quoted(chunk)?);
    }
    let job_file = quoted(job_file)?;
    Ok(format!(
        r#"# Open Job Description, made by `rubor job`. `openjd run` draws it here, farms draw it on many machines.
specificationVersion: jobtemplate-2023-09
name: {name}
parameterDefinitions:
  - name: JobFile
    type: PATH
    objectType: FILE
    dataFlow: IN
    default: {job_file}
    description: The job of rubor. Heads and environments that it names have to be there for every machine.
  - name: OutputDir
    type: PATH
    objectType: DIRECTORY
    dataFlow: OUT
    default: "out"
    description: Folder of the results; parts are drawn in its folder chunks.
  - name: Rubor
    type: STRING
    default: "rubor"
    description: The command.
  - name: Adapter
    type: STRING
    default: "0"
    description: Graphics adapter, its number or a part of its name. Adapters differ in the last bits of pixels.
steps:
  - name: Render
    parameterSpace:
      taskParameterDefinitions:
        - name: Frames
          type: STRING
          range:
{range}    script:
      actions:
        onRun:
          command: "{{{{Param.Rubor}}}}"
          args:
            - "render"
            - "--job"
            - "{{{{Param.JobFile}}}}"
            - "--frames"
            - "{{{{Task.Param.Frames}}}}"
            - "--output"
            - "{{{{Param.OutputDir}}}}/chunks/{{{{Task.Param.Frames}}}}"
            - "--adapter"
            - "{{{{Param.Adapter}}}}"
            - "--resume"
            - "--no-video"
            - "--no-export"
          cancelation:
            mode: NOTIFY_THEN_TERMINATE
            notifyPeriodInSeconds: 120
  - name: Gather
    dependencies:
      - dependsOn: Render
    script:
      actions:
        onRun:
          command: "{{{{Param.Rubor}}}}"
          args:
            - "gather"
            - "--job"
            - "{{{{Param.JobFile}}}}"
            - "--output"
            - "{{{{Param.OutputDir}}}}"
            - "--adapter"
            - "{{{{Param.Adapter}}}}"
            - "{{{{Param.OutputDir}}}}/chunks"
"#
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_template_lists_every_frame_once() {
        let text =
            template("a {{Param.X}}\n\"b\"", "a \"b\".json", &["1-10".into(), "11-12".into()]).unwrap();
        assert!(text.contains("name: \"rubor a Param.X\\\"b\\\"\"\n"), "{text}");
        assert!(
            text.contains("          range:\n            - \"1-10\"\n            - \"11-12\"\n    script:\n")
        );
        assert!(
            text.contains("default: \"a \\\"b\\\".json\"\n") && text.contains("\"{{Task.Param.Frames}}\"")
        );
    }
}
