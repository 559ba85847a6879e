#include "blob.h"

#include "dds/ddsi/ddsi_domaingv.h"
#include "dds/ddsi/ddsi_entity.h"
#include "dds/ddsi/ddsi_guid.h"
#include "dds/ddsi/ddsi_proxy_participant.h"
#include "dds/ddsrt/random.h"
#include "ddsi__entity.h"
#include "ddsi__entity_index.h"
#include "ddsi__proxy_endpoint.h"
#include "ddsi__proxy_participant.h"

/* Participants of others that are known at a time. Each takes 13 kB, and whoever sends a datagram makes one. */
#define MAX_PARTICIPANTS 512u

/* True if a participant has announced a writer or reader of a topic, as every node of ROS 2 does. */
static bool has_endpoints (struct ddsi_proxy_participant *participant)
{
  bool found = false;
  ddsrt_mutex_lock (&participant->e.lock);
  for (const struct ddsi_proxy_endpoint_common *each = participant->endpoints; each != NULL && !found; each = each->next_ep)
  {
    const struct ddsi_entity_common *entity = ddsi_entity_common_from_proxy_endpoint_common (each);
    found = !ddsi_is_builtin_entityid (entity->guid.entityid, participant->vendor);
  }
  ddsrt_mutex_unlock (&participant->e.lock);
  return found;
}

bool lattice_make_room (struct ddsi_domaingv *domain, int64_t now)
{
  struct ddsi_entity_enum_proxy_participant each;
  struct ddsi_proxy_participant *participant;
  uint32_t count = 0;
  ddsi_entidx_enum_proxy_participant_init (&each, domain->entity_index);
  while (count < MAX_PARTICIPANTS && ddsi_entidx_enum_proxy_participant_next (&each) != NULL)
    count++;
  ddsi_entidx_enum_proxy_participant_fini (&each);
  if (count < MAX_PARTICIPANTS)
    return true;

  /* Any of them: times are what the sender says. */
  ddsi_guid_t chosen;
  uint32_t candidates = 0;
  ddsi_entidx_enum_proxy_participant_init (&each, domain->entity_index);
  while ((participant = ddsi_entidx_enum_proxy_participant_next (&each)) != NULL)
  {
    if (!has_endpoints (participant) && ddsrt_random () % ++candidates == 0)
      chosen = participant->e.guid;
  }
  ddsi_entidx_enum_proxy_participant_fini (&each);
  return candidates > 0
    && ddsi_delete_proxy_participant_by_guid (domain, &chosen, (ddsrt_wctime_t) { now }, false) == 0;
}
