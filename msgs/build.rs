//! Makes the structs of the messages from their texts.

use std::env;
use std::error::Error;
use std::ffi::OsStr;
use std::fs;
use std::path::Path;

use lattice_msgs_generator::Generator;

fn main() -> Result<(), Box<dyn Error>> {
    let mut generator = Generator::new().inside_lattice_msgs();
    // Not the whole folder, as `generate` would say: other files of this crate do not matter.
    for folder in ["msg", "srv", "action", "definitions"] {
        println!("cargo::rerun-if-changed={folder}");
    }
    // The texts of this package, which lie as colcon wants them.
    generator = generator.package("lattice_msgs", ".");
    for folder in fs::read_dir("definitions")? {
        let path = folder?.path();
        let package = path.file_name().and_then(OsStr::to_str);
        let package = package.ok_or("a folder whose name is no text")?;
        // The structs of this one are generic: src/rmw_dds_common.rs.
        if package != "rmw_dds_common" {
            generator = generator.package(package, &path);
        }
    }
    // One layout under three names.
    let livox = "definitions/livox_ros_driver2";
    generator = generator
        .package("livox_ros_driver", livox)
        .package("livox_interfaces", livox);
    let out = env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?;
    generator.write_to(Path::new(&out))?;
    Ok(())
}
