//! Topics of serialised bytes under any type name.

use std::ffi::{CStr, c_char};
use std::mem::size_of;
use std::ptr;
use std::sync::OnceLock;

use cyclors::{
    DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY, cdds_create_blob_topic, dds_create_topic_sertype,
    dds_get_entity_sertype, ddsi_serdata, ddsi_serdata_ops, ddsi_sertype, ddsi_sertype_init_flags,
    ddsi_sertype_ops, ddsi_sertype_unref,
};

use super::entity::{Entity, check};
use super::log::explained;

/// Functions of blob topics, which live as long as the process.
struct BlobOps {
    sertype: *const ddsi_sertype_ops,
    serdata: ddsi_serdata_ops,
}

// SAFETY: tables of functions that nobody changes.
unsafe impl Send for BlobOps {}
// SAFETY: as above.
unsafe impl Sync for BlobOps {}

static OPS: OnceLock<BlobOps> = OnceLock::new();

/// Makes a topic in a participant.
pub(super) fn topic(participant: &Entity, name: &CStr, dds_type: &CStr) -> Result<Entity, String> {
    let ops = match OPS.get() {
        Some(ops) => ops,
        None => {
            let ops = blob_ops(participant, name, dds_type)?;
            OPS.get_or_init(|| ops)
        }
    };
    // SAFETY: Cyclone takes the type over, and frees it with the function of the blob topics, `free`; of
    // a topic that is not made we give it back.
    unsafe {
        let mut sertype = libc::calloc(1, size_of::<ddsi_sertype>()).cast::<ddsi_sertype>();
        if sertype.is_null() {
            return Err("no memory for a type".to_owned());
        }
        let flags = DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY;
        ddsi_sertype_init_flags(sertype, dds_type.as_ptr(), ops.sertype, &ops.serdata, flags);
        let (parent, none) = (participant.handle(), ptr::null());
        let made = explained(|| {
            let (name, place) = (name.as_ptr(), &mut sertype);
            dds_create_topic_sertype(parent, name, place, none, ptr::null(), ptr::null())
        });
        made.inspect_err(|_| ddsi_sertype_unref(sertype))
    }
}

/// The functions of a blob topic of `cyclors`, with the one that it lacks: Cyclone calls it to trace samples.
/// The topic is one that is wanted anyway: permissions would have to allow any other.
fn blob_ops(participant: &Entity, name: &CStr, dds_type: &CStr) -> Result<BlobOps, String> {
    let mut sertype: *const ddsi_sertype = ptr::null();
    // SAFETY: strings that end with 0 and are copied; the type is that of a topic that is alive.
    unsafe {
        let (name, dds_type) = (name.as_ptr().cast_mut(), dds_type.as_ptr().cast_mut());
        let parent = participant.handle();
        let topic = explained(|| cdds_create_blob_topic(parent, name, dds_type, true))?;
        let _ = check(dds_get_entity_sertype(topic.handle(), &mut sertype))?;
        let found = sertype.as_ref().and_then(|sertype| {
            Some(BlobOps {
                sertype: sertype.ops,
                serdata: ddsi_serdata_ops {
                    print: Some(print),
                    ..*sertype.serdata_ops.as_ref()?
                },
            })
        });
        found.ok_or_else(|| "a topic without a type".to_owned())
    }
}

/// # Safety
///
/// `text` has room for `size` bytes.
unsafe extern "C" fn print(
    _: *const ddsi_sertype,
    _: *const ddsi_serdata,
    text: *mut c_char,
    size: usize,
) -> usize {
    let words = c"(serialised)";
    if let Some(room) = size.checked_sub(1) {
        let length = words.count_bytes().min(room);
        // SAFETY: there is room for so many and a zero.
        unsafe {
            ptr::copy_nonoverlapping(words.as_ptr(), text, length);
            text.add(length).write(0);
        }
    }
    words.count_bytes()
}
