"""Runs the launch files with a stand-in for launch and launch_ros, which takes what the real ones take, and
compares the XML ones with the elements and attributes that launch documents.

    launch_check.py LAUNCH_FOLDER     prints a line of JSON: what each file starts
"""

import json
import sys
import types
from pathlib import Path
from xml.etree import ElementTree

# Names of the arguments that launch (Jazzy) knows of what is used here; the first ones by position.
CLASSES = {
    "launch": {"LaunchDescription": "entities"},
    "launch.actions": {
        "DeclareLaunchArgument": "name default_value description choices condition",
        "IncludeLaunchDescription": "launch_description_source launch_arguments condition",
        "SetEnvironmentVariable": "name value condition",
        "Shutdown": "reason",
    },
    "launch.launch_description_sources": {"PythonLaunchDescriptionSource": "location"},
    "launch.substitutions": {
        "EnvironmentVariable": "name default_value",
        "LaunchConfiguration": "variable_name default",
        "PathJoinSubstitution": "substitutions",
        "PythonExpression": "expression python_modules",
    },
    "launch_ros.actions": {
        "Node": "executable package name namespace exec_name parameters remappings ros_arguments"
        " arguments output respawn respawn_delay on_exit condition",
    },
    "launch_ros.parameter_descriptions": {"ParameterValue": "value value_type"},
    "launch_ros.substitutions": {"FindPackageShare": "package"},
}
ELEMENTS = {
    "launch": "",
    "arg": "name default description",
    "set_env": "name value",
    "include": "file",
    "node": "pkg exec name namespace output ros_args args respawn respawn_delay",
    "param": "from name value type",
    "remap": "from to",
}


def stand_in(name, known):
    def init(self, *args, **more):
        assert len(args) <= len(known), f"{name} takes {known}"
        self.given = dict(zip(known, args))
        for key, value in more.items():
            assert key in known and key not in self.given, f"{name} takes no {key}"
            self.given[key] = value

    return type(name, (), {"__init__": init})


def install():
    sys.modules["launch_ros"] = types.ModuleType("launch_ros")
    for module, classes in CLASSES.items():
        sys.modules[module] = types.ModuleType(module)
        for name, known in classes.items():
            setattr(sys.modules[module], name, stand_in(name, known.split()))


def visit(value, found, declared, used):
    given = getattr(value, "given", {})
    match type(value).__name__:
        case "DeclareLaunchArgument":
            declared.add(given["name"])
        case "LaunchConfiguration":
            used.add(given["variable_name"])
        case "Node":
            assert given["package"] == "lattice_nodes"
            found.append([given["executable"], given["name"]])
    parts = given if hasattr(value, "given") else value
    for part in parts.values() if isinstance(parts, dict) else parts:
        if hasattr(part, "given") or isinstance(part, (list, tuple, dict)):
            visit(part, found, declared, used)


def check_python(path):
    space, found, declared, used = {}, [], set(), set()
    exec(compile(path.read_text(), path, "exec"), space)
    visit([space["generate_launch_description"]()], found, declared, used)
    return found, declared, used


def check_xml(path):
    found, declared, used = [], set(), set()
    for element in ElementTree.parse(path).iter():
        known = ELEMENTS[element.tag].split()
        assert set(element.attrib) <= set(known), f"{path}: {element.tag} {element.attrib}"
        if element.tag == "arg":
            declared.add(element.attrib["name"])
        for text in element.attrib.values():
            used |= {part.split(")")[0] for part in text.split("$(var ")[1:]}
        if element.tag == "node":
            assert element.attrib["pkg"] == "lattice_nodes"
            found.append([element.attrib["exec"], element.attrib["name"]])
    return found, declared, used


def main():
    install()
    found, arguments = {}, {}
    for path in sorted(Path(sys.argv[1]).iterdir()):
        check = check_python if path.suffix == ".py" else check_xml
        found[path.name], declared, used = check(path)
        arguments[path.name] = declared, used
    for name, (declared, used) in arguments.items():
        # A file that includes another has its arguments too.
        if name.startswith("replay"):
            declared |= arguments[name.replace("replay", "mapping")][0]
        assert used <= declared, f"{name}: {used - declared} is not declared"
    print(json.dumps(found))


main()
