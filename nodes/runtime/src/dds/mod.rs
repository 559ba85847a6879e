//! The transport over RustDDS. All that names a RustDDS type is here.

mod events;
mod participant;
mod payload;
mod probe;
mod reader;
mod writer;

pub(crate) use participant::{Dds, effective_receive_buffer};

use rustdds::rpc::SampleIdentity;
use rustdds::{GUID, SequenceNumber};

use super::port::{EndpointId, SampleId};

fn endpoint_id(guid: GUID) -> EndpointId {
    EndpointId(guid.to_bytes())
}

fn sample_id(identity: SampleIdentity) -> SampleId {
    SampleId {
        writer: endpoint_id(identity.writer_guid),
        number: identity.sequence_number.into(),
    }
}

fn sample_identity(id: SampleId) -> SampleIdentity {
    SampleIdentity {
        writer_guid: GUID::from_bytes(id.writer.0),
        sequence_number: SequenceNumber::from(id.number),
    }
}
