#include "blob.h"

#include "dds/ddsi/ddsi_entity.h"
#include "dds/ddsi/ddsi_endpoint.h"
#include "dds/ddsi/ddsi_proxy_endpoint.h"
#include "dds/ddsi/ddsi_whc.h"
#include "dds__types.h"
#include "dds__writer.h"
#include "ddsi__endpoint.h"
#include "ddsi__whc.h"

/* True while a writer is made that overwrites nothing that a reader may still ask for. */
static _Thread_local bool keeps;

static void (*reader_left) (void *, uint64_t);

dds_entity_t lattice_writer (dds_entity_t participant, dds_entity_t topic, const dds_qos_t *qos, bool keep)
{
  keeps = keep;
  const dds_entity_t writer = dds_create_writer (participant, topic, qos, NULL);
  keeps = false;
  return writer;
}

bool lattice_keeps_unacknowledged (void)
{
  return keeps;
}

bool lattice_is_full (dds_entity_t writer, size_t length, size_t most)
{
  struct dds_writer *locked;
  if (dds_writer_lock (writer, &locked) != DDS_RETCODE_OK)
    return false;
  struct ddsi_whc_state state;
  ddsi_whc_get_state (locked->m_whc, &state);
  dds_writer_unlock (locked);
  return state.unacked_bytes > 0 && (state.unacked_bytes > most || length > most - state.unacked_bytes);
}

uint64_t lattice_unacknowledged (dds_entity_t writer)
{
  struct dds_writer *locked;
  if (dds_writer_lock (writer, &locked) != DDS_RETCODE_OK)
    return 0;
  struct ddsi_writer *inner = locked->m_wr;
  ddsrt_mutex_lock (&inner->e.lock);
  const uint64_t written = inner->seq, acknowledged = ddsi_writer_max_drop_seq (inner);
  ddsrt_mutex_unlock (&inner->e.lock);
  dds_writer_unlock (locked);
  return written > acknowledged ? written - acknowledged : 0;
}

void lattice_on_reader_left (void (*callback) (void *, uint64_t))
{
  reader_left = callback;
}

void lattice_reader_left (const struct ddsi_writer *writer, uint64_t acknowledged)
{
  /* Writers of Cyclone's own have no entity of the application. */
  const struct dds_entity *entity = writer->status_cb_entity;
  if (entity == NULL || reader_left == NULL || acknowledged >= writer->seq)
    return;
  void *owner = entity->m_listener.on_publication_matched_arg;
  if (owner != NULL && lattice_is_blob_type (writer->type))
    reader_left (owner, writer->seq - acknowledged);
}
