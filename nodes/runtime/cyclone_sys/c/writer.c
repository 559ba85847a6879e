#include "blob.h"

#include "dds/ddsi/ddsi_entity.h"
#include <string.h>

#include "dds/ddsi/ddsi_domaingv.h"
#include "dds/ddsi/ddsi_endpoint.h"
#include "dds/ddsi/ddsi_entity_index.h"
#include "dds/ddsi/ddsi_guid.h"
#include "dds/ddsi/ddsi_proxy_endpoint.h"
#include "dds/ddsi/ddsi_thread.h"
#include "dds/ddsi/ddsi_whc.h"
#include "dds__entity.h"
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

bool lattice_is_known_to (dds_entity_t reader, const uint8_t writer[16])
{
  struct dds_entity *entity;
  if (dds_entity_pin (reader, &entity) != DDS_RETCODE_OK)
    return true;
  ddsi_guid_t guid;
  _Static_assert (sizeof (guid) == 16, "GUID");
  memcpy (&guid, writer, sizeof (guid));
  guid = ddsi_ntoh_guid (guid);
  struct ddsi_domaingv *domain = &entity->m_domain->gv;
  ddsi_thread_state_awake (ddsi_lookup_thread_state (), domain);
  struct ddsi_proxy_writer *proxy = ddsi_entidx_lookup_proxy_writer_guid (domain->entity_index, &guid);
  bool known = true;
  if (proxy != NULL)
  {
    ddsrt_mutex_lock (&proxy->e.lock);
    known = proxy->have_seen_heartbeat;
    ddsrt_mutex_unlock (&proxy->e.lock);
  }
  ddsi_thread_state_asleep (ddsi_lookup_thread_state ());
  dds_entity_unpin (entity);
  return known;
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
