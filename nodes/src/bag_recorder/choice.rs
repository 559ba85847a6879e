//! Selection of topics by name, as in `ros2 bag record`.

use regex::Regex;

/// Topics to record.
#[derive(Clone, Debug, Default)]
pub struct Choice {
    /// Full names.
    pub topics: Vec<String>,
    /// True for every topic.
    pub all: bool,
    /// Pattern matched anywhere in a name.
    pub regex: Option<Regex>,
    /// Excluded full names.
    pub exclude: Vec<String>,
    /// Pattern of excluded names, matched anywhere in a name.
    pub exclude_regex: Option<Regex>,
    /// True to include topics with a part that begins with `_`, even if not named.
    pub hidden: bool,
}

impl Choice {
    /// True if a topic of this name is selected.
    pub fn wants(&self, topic: &str) -> bool {
        let is = |list: &[String]| list.iter().any(|name| name == topic);
        let like = |regex: &Option<Regex>| regex.as_ref().is_some_and(|r| r.is_match(topic));
        if is(&self.exclude) || like(&self.exclude_regex) {
            return false;
        }
        let hidden = topic.split('/').any(|part| part.starts_with('_'));
        is(&self.topics) || ((self.all || like(&self.regex)) && (self.hidden || !hidden))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(choice: &Choice) -> Vec<&'static str> {
        let topics = ["/tf", "/robot/points", "/robot/_hidden", "/rosout"];
        topics.into_iter().filter(|t| choice.wants(t)).collect()
    }

    #[test]
    fn topics_are_chosen_by_name_and_likeness() {
        let named = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        let like = |text| Some(Regex::new(text).unwrap());
        let mut choice = Choice {
            topics: named(&["/tf", "/robot/_hidden"]),
            ..Choice::default()
        };
        assert_eq!(wanted(&choice), ["/tf", "/robot/_hidden"]);
        choice.regex = like("points|hid");
        assert_eq!(wanted(&choice), ["/tf", "/robot/points", "/robot/_hidden"]);
        choice = Choice {
            all: true,
            ..Choice::default()
        };
        assert_eq!(wanted(&choice), ["/tf", "/robot/points", "/rosout"]);
        choice.hidden = true;
        choice.exclude = named(&["/tf"]);
        choice.exclude_regex = like("^/ros");
        assert_eq!(wanted(&choice), ["/robot/points", "/robot/_hidden"]);
    }
}
