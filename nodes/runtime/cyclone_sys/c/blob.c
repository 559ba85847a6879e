#include "blob.h"

#include <stdlib.h>
#include <string.h>

#include "dds/ddsc/dds_internal_api.h"
#include "dds/ddsi/ddsi_radmin.h"
#include "dds/ddsi/ddsi_serdata.h"
#include "dds/ddsi/ddsi_sertype.h"
#include "dds/ddsrt/endian.h"
#include "ddsi__protocol.h"
#include "ddsi__vendor.h"
#include "ddsi__xmsg.h"

/* Encapsulation header in front of every sample. */
#define HEADER_BYTES 4u

/* Samples on the wire are multiples of this, bytes. Cyclone reads so far also where a sample ends before. */
#define WORD_BYTES 4u

/* Parameters of the inline QoS that name the request of a reply (DDS-RPC 1.0, 7.8.2), and Fast DDS's own from before. */
#define PID_RELATED_SAMPLE_IDENTITY 0x0083u
#define PID_FASTDDS_RELATED_SAMPLE_IDENTITY 0x800fu

/* GUID and sequence number. */
#define IDENTITY_BYTES 24u

struct blob {
  struct ddsi_serdata common;
  uint32_t length;
  int64_t number;
  bool has_related;
  struct lattice_identity related;
  uint8_t bytes[];
};

static const struct ddsi_serdata_ops serdata_ops;

static const struct blob *blob_of (const struct ddsi_serdata *data)
{
  return (const struct blob *) data;
}

static struct blob *blob_new (const struct ddsi_sertype *type, enum ddsi_serdata_kind kind, size_t length)
{
  if (length > INT32_MAX)
    return NULL;
  const size_t room = (length + WORD_BYTES - 1) / WORD_BYTES * WORD_BYTES;
  struct blob *blob = malloc (sizeof (*blob) + room);
  if (blob == NULL)
    return NULL;
  memset (blob, 0, sizeof (*blob));
  memset (blob->bytes + length, 0, room - length);
  ddsi_serdata_init (&blob->common, type, kind);
  blob->length = (uint32_t) length;
  return blob;
}

/* Sizes and places of the network are checked before they are used: a sample that contradicts itself is refused. */

static uint32_t read_u16 (const uint8_t *at, bool little)
{
  return little ? (uint32_t) (at[0] | at[1] << 8) : (uint32_t) (at[0] << 8 | at[1]);
}

static uint32_t read_u32 (const uint8_t *at, bool little)
{
  return little ? read_u16 (at, true) | read_u16 (at + 2, true) << 16 : read_u16 (at, false) << 16 | read_u16 (at + 2, false);
}

/* Looks for the identity of a request in a parameter list. */
static void read_related (struct blob *blob, const uint8_t *at, const uint8_t *end, bool little)
{
  while (end - at >= 4)
  {
    const uint32_t pid = read_u16 (at, little), length = read_u16 (at + 2, little);
    at += 4;
    if (pid == DDSI_PID_SENTINEL || (size_t) (end - at) < length)
      return;
    if ((pid == PID_RELATED_SAMPLE_IDENTITY || pid == PID_FASTDDS_RELATED_SAMPLE_IDENTITY) && length >= IDENTITY_BYTES)
    {
      memcpy (blob->related.guid, at, sizeof (blob->related.guid));
      const uint64_t high = read_u32 (at + 16, little), low = read_u32 (at + 20, little);
      blob->related.number = (int64_t) (high << 32 | low);
      blob->has_related = true;
      return;
    }
    at += length;
  }
}

/* Number and inline QoS of the submessage that a sample begins in. Cyclone has brought its fixed fields into our order. */
static void identify (struct blob *blob, const struct ddsi_rdata *first)
{
  const size_t begin = DDSI_RDATA_SUBMSG_OFF (first), end = DDSI_RDATA_PAYLOAD_OFF (first);
  if (end < begin + sizeof (ddsi_rtps_data_datafrag_common_t))
    return;
  const uint8_t *packet = DDSI_RMSG_PAYLOAD (first->rmsg);
  ddsi_rtps_data_datafrag_common_t message;
  memcpy (&message, packet + begin, sizeof (message));
  const uint64_t high = (uint32_t) message.writerSN.high, low = message.writerSN.low;
  blob->number = (int64_t) (high << 32 | low);
  const size_t qos = begin + offsetof (ddsi_rtps_data_datafrag_common_t, octetsToInlineQos)
    + sizeof (message.octetsToInlineQos) + message.octetsToInlineQos;
  if ((message.smhdr.flags & DDSI_DATA_FLAG_INLINE_QOS) && qos < end)
    read_related (blob, packet + qos, packet + end, message.smhdr.flags & DDSI_RTPS_SUBMESSAGE_FLAG_ENDIANNESS);
}

static struct ddsi_serdata *from_ser (const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                      const struct ddsi_rdata *fragments, size_t size)
{
  struct blob *blob = blob_new (type, kind, size);
  if (blob == NULL)
    return NULL;
  identify (blob, fragments);
  uint32_t done = 0;
  for (; fragments != NULL; fragments = fragments->nextfrag)
  {
    if (fragments->maxp1 <= done)
      continue;
    if (fragments->min > done || fragments->maxp1 > size)
      break;
    const uint8_t *payload = DDSI_RMSG_PAYLOADOFF (fragments->rmsg, DDSI_RDATA_PAYLOAD_OFF (fragments));
    memcpy (blob->bytes + done, payload + (done - fragments->min), fragments->maxp1 - done);
    done = fragments->maxp1;
  }
  if (done == size)
    return &blob->common;
  free (blob);
  return NULL;
}

static struct ddsi_serdata *from_ser_iov (const struct ddsi_sertype *type, enum ddsi_serdata_kind kind,
                                          ddsrt_msg_iovlen_t count, const ddsrt_iovec_t *parts, size_t size)
{
  struct blob *blob = blob_new (type, kind, size);
  if (blob == NULL)
    return NULL;
  size_t done = 0;
  for (ddsrt_msg_iovlen_t part = 0; part < count; part++)
  {
    const size_t length = parts[part].iov_len < size - done ? parts[part].iov_len : size - done;
    memcpy (blob->bytes + done, parts[part].iov_base, length);
    done += length;
  }
  memset (blob->bytes + done, 0, size - done);
  return &blob->common;
}

/* Topics have no keys, and no application samples besides their bytes. */

static struct ddsi_serdata *from_keyhash (const struct ddsi_sertype *type, const struct ddsi_keyhash *hash)
{
  (void) type;
  (void) hash;
  return NULL;
}

static struct ddsi_serdata *from_sample (const struct ddsi_sertype *type, enum ddsi_serdata_kind kind, const void *sample)
{
  (void) type;
  (void) kind;
  (void) sample;
  return NULL;
}

static struct ddsi_serdata *from_loan (const struct ddsi_sertype *type, enum ddsi_serdata_kind kind, const char *sample,
                                       struct dds_loaned_sample *loan, bool will_require_cdr)
{
  (void) type;
  (void) kind;
  (void) sample;
  (void) loan;
  (void) will_require_cdr;
  return NULL;
}

static struct ddsi_serdata *from_psmx (const struct ddsi_sertype *type, struct dds_loaned_sample *loan)
{
  (void) type;
  (void) loan;
  return NULL;
}

static bool to_sample (const struct ddsi_serdata *data, void *sample, void **buffer, void *limit)
{
  (void) data;
  (void) sample;
  (void) buffer;
  (void) limit;
  return false;
}

static bool untyped_to_sample (const struct ddsi_sertype *type, const struct ddsi_serdata *data, void *sample,
                               void **buffer, void *limit)
{
  (void) type;
  return to_sample (data, sample, buffer, limit);
}

static struct ddsi_serdata *to_untyped (const struct ddsi_serdata *data)
{
  struct blob *blob = blob_new (data->type, SDK_KEY, 0);
  if (blob == NULL)
    abort (); /* The interface knows no failure; as everywhere in Cyclone without memory. */
  blob->common.type = NULL;
  blob->common.timestamp.v = INT64_MIN;
  return &blob->common;
}

static bool eqkey (const struct ddsi_serdata *one, const struct ddsi_serdata *other)
{
  (void) one;
  (void) other;
  return true;
}

static void get_keyhash (const struct ddsi_serdata *data, struct ddsi_keyhash *hash, bool force_md5)
{
  (void) data;
  (void) force_md5;
  memset (hash, 0, sizeof (*hash));
}

static uint32_t get_size (const struct ddsi_serdata *data)
{
  return blob_of (data)->length;
}

static void to_ser (const struct ddsi_serdata *data, size_t offset, size_t length, void *to)
{
  memcpy (to, blob_of (data)->bytes + offset, length);
}

static struct ddsi_serdata *to_ser_ref (const struct ddsi_serdata *data, size_t offset, size_t length, ddsrt_iovec_t *place)
{
  place->iov_base = (void *) (blob_of (data)->bytes + offset);
  place->iov_len = length;
  return ddsi_serdata_ref (data);
}

static void to_ser_unref (struct ddsi_serdata *data, const ddsrt_iovec_t *place)
{
  (void) place;
  ddsi_serdata_unref (data);
}

static void free_blob (struct ddsi_serdata *data)
{
  free (data);
}

static size_t print (const struct ddsi_sertype *type, const struct ddsi_serdata *data, char *text, size_t size)
{
  (void) type;
  (void) data;
  const char words[] = "(serialised)";
  const size_t length = size < sizeof (words) ? size : sizeof (words);
  memcpy (text, words, length);
  text[length - 1] = 0;
  return length - 1;
}

static const struct ddsi_serdata_ops serdata_ops = {
  .eqkey = eqkey,
  .get_size = get_size,
  .from_ser = from_ser,
  .from_ser_iov = from_ser_iov,
  .from_keyhash = from_keyhash,
  .from_sample = from_sample,
  .to_ser = to_ser,
  .to_ser_ref = to_ser_ref,
  .to_ser_unref = to_ser_unref,
  .to_sample = to_sample,
  .to_untyped = to_untyped,
  .untyped_to_sample = untyped_to_sample,
  .free = free_blob,
  .print = print,
  .get_keyhash = get_keyhash,
  .from_loaned_sample = from_loan,
  .from_psmx = from_psmx,
};

static void free_type (struct ddsi_sertype *type)
{
  ddsi_sertype_fini (type);
  free (type);
}

static void zero_samples (const struct ddsi_sertype *type, void *samples, size_t count)
{
  (void) type;
  (void) samples;
  (void) count;
}

static void realloc_samples (void **samples, const struct ddsi_sertype *type, void *old, size_t old_count, size_t count)
{
  (void) type;
  (void) old;
  (void) old_count;
  for (size_t i = 0; i < count; i++)
    samples[i] = NULL;
}

static void free_samples (const struct ddsi_sertype *type, void **samples, size_t count, dds_free_op_t op)
{
  (void) type;
  (void) samples;
  (void) count;
  (void) op;
}

/* Types differ in nothing but their names. */

static bool equal_types (const struct ddsi_sertype *one, const struct ddsi_sertype *other)
{
  (void) one;
  (void) other;
  return true;
}

static uint32_t hash_type (const struct ddsi_sertype *type)
{
  (void) type;
  return 0;
}

static const struct ddsi_sertype_ops sertype_ops = {
  .version = ddsi_sertype_v0,
  .free = free_type,
  .zero_samples = zero_samples,
  .realloc_samples = realloc_samples,
  .free_samples = free_samples,
  .equal = equal_types,
  .hash = hash_type,
};

bool lattice_is_blob_type (const struct ddsi_sertype *type)
{
  return type->ops == &sertype_ops;
}

dds_entity_t lattice_topic (dds_entity_t participant, const char *name, const char *type_name)
{
  struct ddsi_sertype *type = calloc (1, sizeof (*type));
  if (type == NULL)
    return DDS_RETCODE_OUT_OF_RESOURCES;
  ddsi_sertype_init_flags (type, type_name, &sertype_ops, &serdata_ops, DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  const dds_entity_t topic = dds_create_topic_sertype (participant, name, &type, NULL, NULL, NULL);
  if (topic < 0)
    ddsi_sertype_unref (type);
  return topic;
}

dds_return_t lattice_write (dds_entity_t writer, const uint8_t *body, size_t length,
                            const struct lattice_identity *related)
{
  const struct ddsi_sertype *type = NULL;
  const dds_return_t code = dds_get_entity_sertype (writer, &type);
  if (code < 0)
    return code;
  if (length > INT32_MAX - HEADER_BYTES - WORD_BYTES)
    return DDS_RETCODE_BAD_PARAMETER;
  const size_t padding = (0 - length) % WORD_BYTES;
  struct blob *blob = blob_new (type, SDK_DATA, HEADER_BYTES + length + padding);
  if (blob == NULL)
    return DDS_RETCODE_OUT_OF_RESOURCES;
  /* Little-endian CDR; the last two bits of the options count the padding (XTypes 1.3, 7.6.3.1.2). */
  const uint8_t header[HEADER_BYTES] = { 0, 1, 0, (uint8_t) padding };
  memcpy (blob->bytes, header, sizeof (header));
  if (length > 0)
    memcpy (blob->bytes + HEADER_BYTES, body, length);
  memset (blob->bytes + HEADER_BYTES + length, 0, padding);
  if (related != NULL)
  {
    blob->has_related = true;
    blob->related = *related;
  }
  return dds_writecdr (writer, &blob->common);
}

dds_return_t lattice_take (dds_entity_t reader, struct lattice_sample *sample)
{
  for (;;)
  {
    struct ddsi_serdata *data = NULL;
    dds_sample_info_t info;
    const dds_return_t count = dds_takecdr (reader, &data, 1, &info, DDS_ANY_STATE);
    if (count <= 0)
      return count;
    if (data == NULL)
      continue;
    /* Others say that writers have come or gone. */
    if (!info.valid_data || data->ops != &serdata_ops)
    {
      ddsi_serdata_unref (data);
      continue;
    }
    const struct blob *blob = blob_of (data);
    *sample = (struct lattice_sample) {
      .blob = data,
      .bytes = blob->bytes,
      .length = blob->length,
      .writer = info.publication_handle,
      .number = blob->number,
      .has_related = blob->has_related,
      .related = blob->related,
    };
    return 1;
  }
}

void lattice_release (struct ddsi_serdata *blob)
{
  ddsi_serdata_unref (blob);
}

void lattice_blob_add_inline_qos (struct ddsi_xmsg *message, const struct ddsi_serdata *data)
{
  if (data->ops != &serdata_ops || !blob_of (data)->has_related)
    return;
  const struct lattice_identity *related = &blob_of (data)->related;
  const uint64_t number = (uint64_t) related->number;
  const uint32_t words[2] = { (uint32_t) (number >> 32), (uint32_t) number };
  const ddsi_parameterid_t parameters[] = { PID_RELATED_SAMPLE_IDENTITY, PID_FASTDDS_RELATED_SAMPLE_IDENTITY };
  for (size_t i = 0; i < sizeof (parameters) / sizeof (parameters[0]); i++)
  {
    uint8_t *to = ddsi_xmsg_addpar (message, parameters[i], IDENTITY_BYTES);
    memcpy (to, related->guid, sizeof (related->guid));
    memcpy (to + sizeof (related->guid), words, sizeof (words));
  }
}

bool lattice_is_of_service (const struct dds_qos *qos)
{
  if (!(qos->present & DDSI_QP_TOPIC_NAME) || qos->topic_name == NULL)
    return false;
  return strncmp (qos->topic_name, "rq/", 3) == 0 || strncmp (qos->topic_name, "rr/", 3) == 0;
}

uint64_t lattice_first_asked_for (const uint8_t vendor[2])
{
  return vendor[0] == 1 && vendor[1] == DDSI_VENDORID_MINOR_EPROSIMA ? 0 : 1;
}

/* Sizes and places that lib.rs repeats. */
#define AT(type, member, place) _Static_assert (offsetof (type, member) == place, #type "." #member)
_Static_assert (sizeof (void *) == 8, "64 bits");
_Static_assert (sizeof (dds_entity_t) == 4 && sizeof (dds_instance_handle_t) == 8, "handles");
_Static_assert (sizeof (dds_guid_t) == 16, "dds_guid_t");
_Static_assert (sizeof (dds_sample_info_t) == 64, "dds_sample_info_t");
AT (dds_sample_info_t, instance_state, 8);
AT (dds_builtintopic_participant_t, qos, 16);
AT (dds_builtintopic_endpoint_t, topic_name, 40);
AT (dds_builtintopic_endpoint_t, type_name, 48);
AT (dds_builtintopic_endpoint_t, qos, 56);
_Static_assert (sizeof (dds_publication_matched_status_t) == 24, "dds_publication_matched_status_t");
AT (dds_publication_matched_status_t, current_count_change, 12);
AT (dds_publication_matched_status_t, last_subscription_handle, 16);
_Static_assert (sizeof (dds_subscription_matched_status_t) == 24, "dds_subscription_matched_status_t");
AT (dds_subscription_matched_status_t, current_count_change, 12);
AT (dds_subscription_matched_status_t, last_publication_handle, 16);
AT (dds_log_data_t, priority, 0);
AT (dds_log_data_t, message, 32);
AT (dds_log_data_t, size, 40);
_Static_assert (DDS_BUILTIN_TOPIC_DCPSPARTICIPANT == 0x7fff0001, "handles of built-in topics");
_Static_assert (DDS_BUILTIN_TOPIC_DCPSPUBLICATION == 0x7fff0003, "handles of built-in topics");
_Static_assert (DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION == 0x7fff0004, "handles of built-in topics");
_Static_assert (DDS_ANY_STATE == 127 && DDS_ALIVE_INSTANCE_STATE == 16, "states");
_Static_assert (DDS_RETCODE_TIMEOUT == -10, "return codes");
_Static_assert (DDS_LC_FATAL == 1 && DDS_LC_ERROR == 2 && DDS_LC_WARNING == 4, "levels of the log");
AT (struct lattice_sample, related, 48);
_Static_assert (sizeof (struct lattice_sample) == 72, "lattice_sample");
