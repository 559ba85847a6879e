/* Topics of serialised bytes under any type name, for the ROS 2 runtime. */
#ifndef LATTICE_BLOB_H
#define LATTICE_BLOB_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "dds/dds.h"

struct ddsi_domaingv;
struct ddsi_serdata;
struct ddsi_sertype;
struct ddsi_writer;
struct ddsi_xmsg;

/* One sample among all: the GUID of its writer, or what the sender names in its place, and its number there. */
struct lattice_identity {
  uint8_t guid[16];
  int64_t number;
};

/* A sample that was taken. Its bytes, encapsulation header first, live until lattice_release. */
struct lattice_sample {
  struct ddsi_serdata *blob;
  const uint8_t *bytes;
  size_t length;
  dds_instance_handle_t writer;
  int64_t number; /* 0: not known, as inside a process */
  bool has_related;
  struct lattice_identity related;
};

/* Makes a topic; a negative number is an error. */
dds_entity_t lattice_topic (dds_entity_t participant, const char *name, const char *type_name);

/* Writes the body of a little-endian CDR sample, and the request that it answers, if there is one. */
dds_return_t lattice_write (dds_entity_t writer, const uint8_t *body, size_t length,
                            const struct lattice_identity *related);

/* Makes a writer. One that keeps overwrites no sample that a reader has not acknowledged, however many there are. */
dds_entity_t lattice_writer (dds_entity_t participant, dds_entity_t topic, const dds_qos_t *qos, bool keep);

/* True if a sample of so many bytes has no place among those that are not acknowledged, of which there may be so many
   bytes. One has, however long. */
bool lattice_is_full (dds_entity_t writer, size_t length, size_t most);

/* Samples of a writer that not all of its reliable readers have acknowledged. */
uint64_t lattice_unacknowledged (dds_entity_t writer);

/* True if a reader has heard from a writer where that stands, which a writer says to the readers that it knows. Also where
   there is no such writer. */
bool lattice_is_known_to (dds_entity_t reader, const uint8_t writer[16]);

/* Has a function called with the argument of the writer's listener for matches when a reliable reader has left, and the
   samples that it did not acknowledge. */
void lattice_on_reader_left (void (*callback) (void *, uint64_t));

/* Takes the next sample with data: 1, or 0 if there is none; a negative number is an error. */
dds_return_t lattice_take (dds_entity_t reader, struct lattice_sample *sample);

/* Gives back a sample. */
void lattice_release (struct ddsi_serdata *blob);

/* Called by Cyclone before the sentinel of the inline QoS of a message. */
void lattice_blob_add_inline_qos (struct ddsi_xmsg *message, const struct ddsi_serdata *data);

/* True for requests and replies of ROS 2. */
bool lattice_is_of_service (const struct dds_qos *qos);

/* Makes room for a participant that is new, where there are very many: any of those without a topic goes. False: there is
   none of that kind. */
bool lattice_make_room (struct ddsi_domaingv *domain, int64_t now);

/* True for the types of all topics that lattice_topic makes. */
bool lattice_is_blob_type (const struct ddsi_sertype *type);

/* True while a writer is made that overwrites no sample that is not acknowledged. */
bool lattice_keeps_unacknowledged (void);

/* Called by Cyclone when a writer loses a reader, which has acknowledged all up to a number: all there will ever be, if it is
   best effort. */
void lattice_reader_left (const struct ddsi_writer *writer, uint64_t acknowledged);

/* The number that a reader asks a writer of a vendor for before it knows what there is. */
uint64_t lattice_first_asked_for (const uint8_t vendor[2]);

#endif
