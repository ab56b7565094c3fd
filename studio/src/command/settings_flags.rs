//! The flags of all settings, made from [`rubor_renderer::settings::leaves`]: nothing here names a setting.
//!
//! ```text
//! defaults < defaults of the command < preset < size of the sequence < job file < flags
//! ```

use std::marker::PhantomData;
use std::sync::LazyLock;

use clap::builder::PossibleValuesParser;
use clap::{Arg, ArgAction, ArgMatches, Command};
use rubor::measure::product;
use rubor::{Failure, Outcome};
use rubor_renderer::settings::{Leaf, Preset, Settings, leaves};
use serde_json::Value;

/// The flags of a command.
pub(crate) trait Purpose {
    /// Whether each flag takes a list; then every combination is drawn.
    const LISTS: bool = false;
    /// Values in place of defaults, by flag; a list is separated by commas.
    const DEFAULTS: &[(&str, &str)] = &[];
}

/// One picture or one sequence.
#[derive(Clone, Debug)]
pub(crate) struct One;
impl Purpose for One {}

/// Changes of settings, by flags.
#[derive(Clone, Debug)]
pub(crate) struct SettingsFlags<P> {
    preset: Option<Preset>,
    /// Values of each flag that was given, in the order of the settings.
    given: Vec<(&'static Leaf, Vec<Value>)>,
    purpose: PhantomData<P>,
}

/// A base and what varies around it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choices {
    pub(crate) base: Settings,
    /// Flags with their values.
    pub(crate) listed: Vec<(String, Vec<Value>)>,
    /// Flags that were given with one value.
    pub(crate) held: Vec<String>,
}

/// A setting with the strings in the form that clap needs.
struct Flag {
    leaf: &'static Leaf,
    name: String,
    value_name: &'static str,
}

/// Heading of the flags in help texts.
const HEADING: &str = "Settings";
const PRESET: &str = "preset";

fn flags() -> &'static [Flag] {
    static FLAGS: LazyLock<Vec<Flag>> = LazyLock::new(|| {
        let flag = |leaf: &'static Leaf| Flag {
            leaf,
            name: leaf.flag(),
            value_name: match leaf.kind.as_str() {
                "array" => &leaf.expected,
                "integer" => "N",
                "number" => "X",
                _ if leaf.is_list => "NAMES",
                _ => "NAME",
            },
        };
        leaves().iter().map(flag).collect()
    });
    &FLAGS
}

/// A value as it is written on the command line.
fn text(leaf: &Leaf, value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(all) => {
            let separator = if leaf.is_list { "," } else { "x" };
            all.iter().map(|v| text(leaf, v)).collect::<Vec<_>>().join(separator)
        }
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), |n| (n as f32).to_string()),
        other => other.to_string(),
    }
}

/// The values of a text: several only where lists are taken, and not of a setting that is a list itself.
fn parse(leaf: &Leaf, text: &str, lists: bool) -> Result<Vec<Value>, String> {
    if !lists || leaf.is_list {
        return Ok(vec![leaf.parse(text)?]);
    }
    text.split(',').map(|t| leaf.parse(t.trim())).collect()
}

impl<P: Purpose> SettingsFlags<P> {
    fn default_text(flag: &Flag) -> String {
        let own = P::DEFAULTS.iter().find(|(name, _)| *name == flag.name);
        own.map_or_else(|| text(flag.leaf, &flag.leaf.default), |(_, text)| (*text).to_owned())
    }

    fn help(flag: &Flag) -> String {
        let about = flag.leaf.about.trim_end_matches('.');
        let default = match Self::default_text(flag) {
            none if none.is_empty() => String::new(),
            default => format!(" [default: {default}]"),
        };
        let separated = match (P::LISTS && !flag.leaf.is_list, flag.leaf.is_list) {
            (true, _) => "; several with commas between",
            (_, true) => ", with commas between",
            _ => "",
        };
        format!("{about}: {}{separated}{default}", flag.leaf.expected)
    }

    /// The values of settings without a flag: the defaults of the command, and the preset.
    fn lists(&self) -> Outcome<Vec<Vec<Value>>> {
        let of_preset = self.preset.map(|p| serde_json::to_value(p.quality())).transpose();
        let of_preset = of_preset.map_err(Failure::input)?;
        let mut lists = Vec::new();
        for flag in flags() {
            let given = self.given.iter().find(|(leaf, _)| leaf.path == flag.leaf.path);
            let own = P::DEFAULTS.iter().find(|(name, _)| *name == flag.name);
            let values = match (given, &of_preset, own) {
                (Some((_, values)), ..) => values.clone(),
                (None, Some(quality), _) if flag.leaf.path[0] == "quality" => {
                    vec![quality[&flag.leaf.path[1]].clone()]
                }
                (None, _, Some((name, text))) => parse(flag.leaf, text, P::LISTS)
                    .map_err(|e| Failure::job(format!("the default of --{name}: {e}")))?,
                _ => continue,
            };
            lists.push(values.iter().map(|value| flag.leaf.change(value)).collect());
        }
        Ok(lists)
    }

    /// The preset, for settings that a job file leaves out.
    pub(crate) fn preset(&self) -> Option<Preset> {
        self.preset
    }

    /// Names of the flags that were given.
    pub(crate) fn given(&self) -> Vec<String> {
        self.given.iter().map(|(leaf, _)| leaf.flag()).collect()
    }

    /// Whether a flag of quality was given.
    pub(crate) fn says_quality(&self) -> bool {
        self.given.iter().any(|(leaf, _)| leaf.path[0] == "quality")
    }

    /// Puts the flags that were given over settings.
    pub(crate) fn overlay(&self, settings: &mut Settings) -> Outcome {
        for (leaf, values) in &self.given {
            values.iter().try_for_each(|value| settings.overlay(&leaf.change(value)))?;
        }
        Ok(settings.validate()?)
    }

    /// The settings of a command without a job file. `size` is that of the sequence, below the flag.
    pub(crate) fn settings(&self, size: Option<[u32; 2]>) -> Outcome<Settings> {
        let mut settings = Settings::default();
        for list in self.lists()? {
            list.iter().try_for_each(|change| settings.overlay(change))?;
        }
        settings.output.size = size.unwrap_or(settings.output.size);
        self.overlay(&mut settings)?;
        Ok(settings)
    }

    /// The settings of all flags with one value, the flags with several values, and those that were given with one.
    pub(crate) fn choices(&self) -> Outcome<Choices> {
        let mut base = Settings::default();
        for list in self.lists()? {
            if let [change] = &list[..] {
                base.overlay(change)?;
            }
        }
        // What varies has the command's default in the base.
        for (leaf, _) in self.given.iter().filter(|(_, values)| values.len() > 1) {
            let own = P::DEFAULTS.iter().find(|(name, _)| *name == leaf.flag());
            let values = own.and_then(|(_, text)| parse(leaf, text, P::LISTS).ok()).unwrap_or_default();
            if let [value] = &values[..] {
                base.overlay(&leaf.change(value))?;
            }
        }
        let (held, listed): (Vec<_>, Vec<_>) = self.given.iter().partition(|(_, values)| values.len() == 1);
        Ok(Choices {
            base,
            listed: listed.into_iter().map(|(leaf, values)| (leaf.flag(), values.clone())).collect(),
            held: held.into_iter().map(|(leaf, _)| leaf.flag()).collect(),
        })
    }

    /// Every combination of the lists.
    pub(crate) fn all(&self) -> Outcome<Vec<Settings>> {
        product(&Settings::default(), &self.lists()?)
    }
}

impl<P: Purpose> clap::Args for SettingsFlags<P> {
    fn augment_args(command: Command) -> Command {
        let names = Preset::ALL.map(Preset::name);
        let preset = Arg::new(PRESET)
            .long(PRESET)
            .value_name("NAME")
            .value_parser(PossibleValuesParser::new(names))
            .help("Quality that the flags below start from [default: review]")
            .help_heading(HEADING);
        flags().iter().fold(command.arg(preset), |command, flag| {
            let leaf = flag.leaf;
            command.arg(
                Arg::new(flag.name.as_str())
                    .long(flag.name.as_str())
                    .value_name(if P::LISTS && !leaf.is_list { "LIST" } else { flag.value_name })
                    .action(ArgAction::Set)
                    .allow_hyphen_values(true)
                    .value_parser(move |text: &str| parse(leaf, text, P::LISTS).map(Parsed))
                    .help(Self::help(flag))
                    .help_heading(HEADING),
            )
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

/// Values of a flag; a plain list would be several values to clap.
#[derive(Clone, Debug)]
struct Parsed(Vec<Value>);

impl<P: Purpose> clap::FromArgMatches for SettingsFlags<P> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut flags = Self { preset: None, given: Vec::new(), purpose: PhantomData };
        flags.update_from_arg_matches(matches)?;
        Ok(flags)
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        if let Some(name) = matches.get_one::<String>(PRESET) {
            self.preset = Preset::ALL.into_iter().find(|p| p.name() == name);
        }
        for flag in flags() {
            if let Some(Parsed(values)) = matches.get_one::<Parsed>(&flag.name) {
                self.given.retain(|(leaf, _)| leaf.path != flag.leaf.path);
                self.given.push((flag.leaf, values.clone()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches;

    use super::*;

    #[derive(Debug)]
    struct Many;
    impl Purpose for Many {
        const LISTS: bool = true;
        const DEFAULTS: &[(&str, &str)] = &[("size", "32x24"), ("scatter", "none,separable:5")];
    }

    fn parsed<P: Purpose>(arguments: &[&str]) -> Result<SettingsFlags<P>, clap::Error> {
        let command = <SettingsFlags<P> as clap::Args>::augment_args(Command::new("x").no_binary_name(true));
        SettingsFlags::from_arg_matches(&command.try_get_matches_from(arguments)?)
    }

    fn error<P: Purpose>(arguments: &[&str]) -> String {
        let error = parsed::<P>(arguments).map(|_| ()).expect_err("it is wrong");
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    }

    #[test]
    fn every_setting_has_a_flag_that_changes_it_and_nothing_else() {
        let others = [
            ("size", "12x34"),
            ("supersampling", "2"),
            ("channels", "depth,ids"),
            ("antialias-preset", "ultra"),
            ("antialias-patterns", "published"),
            ("profile", "jimenez-four"),
            ("shadow-size", "64"),
            ("exposure", "0.25"),
        ];
        for flag in flags() {
            let text = match others.iter().find(|(name, _)| *name == flag.name) {
                Some((_, text)) => *text,
                // The last method of a group is not its default.
                None => flag.leaf.expected.split([' ', '(', ',']).next().expect("a method"),
            };
            let long = format!("--{}", flag.name);
            let settings = parsed::<One>(&[&long, text]).unwrap().settings(None).unwrap();
            let mut expected = Settings::default();
            expected.overlay(&flag.leaf.change(&flag.leaf.parse(text).unwrap())).unwrap();
            assert_eq!(settings, expected, "{long} {text}");
        }
    }

    #[test]
    fn order_is_defaults_preset_sequence_flags() {
        let settings = |arguments: &[&str], size| parsed::<One>(arguments).unwrap().settings(size).unwrap();
        assert_eq!(settings(&[], None), Settings::default());
        let draft = settings(&["--preset", "draft", "--scatter", "none"], Some([9, 8]));
        assert_eq!(draft.quality.antialias, Preset::Draft.quality().antialias);
        assert_eq!((draft.quality.scatter.name(), draft.output.size), ("none", [9, 8]));
        assert_eq!(settings(&["--size", "5x6"], Some([9, 8])).output.size, [5, 6]);
        let mut job = Settings::default();
        job.quality.shadow_size = 77;
        parsed::<One>(&["--exposure", "3"]).unwrap().overlay(&mut job).unwrap();
        assert_eq!((job.quality.shadow_size, job.look.exposure), (77, 3.0));
    }

    #[test]
    fn lists_make_every_combination() {
        let all = |arguments: &[&str]| parsed::<Many>(arguments).unwrap().all().unwrap();
        let found = all(&["--antialias", "none,mlaa", "--channels", "ids,depth"]);
        let names: Vec<String> =
            found.iter().map(|s| format!("{} {}", s.quality.scatter, s.quality.antialias)).collect();
        assert_eq!(names, ["none none", "separable:5 none", "none mlaa", "separable:5 mlaa"]);
        assert!(found.iter().all(|s| s.output.size == [32, 24] && s.output.channels.len() == 2));
        assert_eq!(all(&["--preset", "draft"]).len(), 1, "a preset is one choice of quality");
        assert_eq!(all(&["--size", "8x8,9x9"]).len(), 4);
    }

    #[test]
    fn one_value_is_held_and_several_vary() {
        let arguments = ["--scatter", "none,separable:5", "--transmit", "none", "--shadow-size", "64"];
        let found = parsed::<Many>(&arguments).unwrap().choices().unwrap();
        assert_eq!(found.base.quality.transmit.to_string(), "none");
        assert_eq!((found.base.quality.shadow_size, found.base.output.size), (64, [32, 24]));
        assert_eq!(
            found.base.quality.scatter,
            Settings::default().quality.scatter,
            "what varies is not in the base"
        );
        assert_eq!(found.listed, [("scatter".to_owned(), vec!["none".into(), "separable:5".into()])]);
        assert!(found.held.contains(&"transmit".to_owned()) && !found.held.contains(&"size".to_owned()));
    }

    #[test]
    fn wrong_values_get_the_message_of_the_setting() {
        assert!(error::<One>(&["--scatter", "separable:8"]).contains("N odd, 5 to 65"));
        assert!(error::<One>(&["--size", "wide"]).contains("WIDTHxHEIGHT"));
        assert!(error::<One>(&["--exposure", "-1"]).contains("found -1"));
        assert!(error::<One>(&["--scatter", "none,separable:5"]).contains("none,separable:5"));
        assert!(error::<Many>(&["--scatter", "none,separable:8"]).contains("separable:8"));
        assert!(error::<One>(&["--preset", "finale"]).contains("final"));
    }

    #[test]
    fn help_has_words_range_and_default() {
        let help = |name: &str| {
            let flag = flags().iter().find(|f| f.name == name).expect("it is a setting");
            SettingsFlags::<Many>::help(flag)
        };
        assert!(help("shadow-size").ends_with("16 to 16384; several with commas between [default: 2048]"));
        assert!(help("scatter").ends_with("[default: none,separable:5]"));
        assert!(help("exposure").ends_with("[default: 1.8]"));
        assert!(help("size").ends_with("[default: 32x24]"));
        assert!(!help("channels").contains("default"));
    }
}
