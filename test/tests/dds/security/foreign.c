/* A participant of Debian's Cyclone DDS, secured as rmw_cyclonedds_cpp does it: hears and says words on one
   topic, and calls a service.

       foreign DOMAIN ENCLAVE PLUGINS TOPIC SERVICE

   It prints "heard WORD" for each word, and "answered MESSAGE" for the reply of std_srvs/srv/Trigger. */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "foreign.h"

static void property(dds_qos_t *qos, const char *name, const char *start, const char *end) {
  char value[4096];
  snprintf(value, sizeof value, "%s%s", start, end);
  dds_qset_prop(qos, name, value);
}

static dds_qos_t *secured(const char *enclave, const char *plugins) {
  const char *files[][2] = {
    {"dds.sec.auth.identity_ca", "/identity_ca.cert.pem"},
    {"dds.sec.auth.identity_certificate", "/cert.pem"},
    {"dds.sec.auth.private_key", "/key.pem"},
    {"dds.sec.access.permissions_ca", "/permissions_ca.cert.pem"},
    {"dds.sec.access.governance", "/governance.p7s"},
    {"dds.sec.access.permissions", "/permissions.p7s"},
  };
  const char *parts[][3] = {
    {"auth", "auth", "authentication"},
    {"access", "ac", "access_control"},
    {"crypto", "crypto", "crypto"},
  };
  dds_qos_t *qos = dds_create_qos();
  char name[100], path[2048];
  for (int i = 0; i < 6; i++) {
    snprintf(path, sizeof path, "%s%s", enclave, files[i][1]);
    property(qos, files[i][0], "file:", path);
  }
  for (int i = 0; i < 3; i++) {
    snprintf(name, sizeof name, "dds.sec.%s.library.path", parts[i][0]);
    snprintf(path, sizeof path, "%s/libdds_security_%s.so", plugins, parts[i][1]);
    property(qos, name, path, "");
    snprintf(name, sizeof name, "dds.sec.%s.library.init", parts[i][0]);
    property(qos, name, "init_", parts[i][2]);
    snprintf(name, sizeof name, "dds.sec.%s.library.finalize", parts[i][0]);
    property(qos, name, "finalize_", parts[i][2]);
  }
  return qos;
}

static dds_entity_t made(const char *what, dds_entity_t entity) {
  if (entity < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(-entity));
    exit(1);
  }
  return entity;
}

static dds_entity_t participant;
static dds_qos_t *reliable;

static dds_entity_t topic(const dds_topic_descriptor_t *type, const char *start, const char *name,
                          const char *end) {
  char full[300];
  snprintf(full, sizeof full, "%s%s%s", start, name, end);
  return made(full, dds_create_topic(participant, type, full, NULL, NULL));
}

int main(int argc, char **argv) {
  if (argc != 6) return 2;
  dds_qos_t *qos = secured(argv[2], argv[3]);
  dds_domainid_t domain = (dds_domainid_t) atoi(argv[1]);
  participant = made("participant", dds_create_participant(domain, qos, NULL));
  reliable = dds_create_qos();
  dds_qset_reliability(reliable, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(reliable, DDS_HISTORY_KEEP_LAST, 100);

  dds_entity_t talk = topic(&std_msgs_msg_dds__String__desc, "rt", argv[4], "");
  dds_entity_t asks = topic(&std_srvs_srv_dds__Trigger_Request__desc, "rq", argv[5], "Request");
  dds_entity_t replies = topic(&std_srvs_srv_dds__Trigger_Response__desc, "rr", argv[5], "Reply");
  dds_entity_t says = made("writer", dds_create_writer(participant, talk, reliable, NULL));
  dds_entity_t hears = made("reader", dds_create_reader(participant, talk, reliable, NULL));
  dds_entity_t asking = made("client", dds_create_writer(participant, asks, reliable, NULL));
  dds_entity_t answers = made("answers", dds_create_reader(participant, replies, reliable, NULL));
  setvbuf(stdout, NULL, _IOLBF, 0);

  std_msgs_msg_dds__String_ word = {"foreign"};
  bool asked = false;
  /* Until the test ends the process. */
  for (;; dds_sleepfor(DDS_MSECS(50))) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    dds_publication_matched_status_t server;
    dds_subscription_matched_status_t replier;
    dds_write(says, &word);
    while (dds_take(hears, sample, &info, 1, 1) > 0) {
      if (info.valid_data) {
        const char *heard = ((std_msgs_msg_dds__String_ *) sample[0])->data;
        if (strcmp(heard, word.data) != 0) printf("heard %s\n", heard);
      }
      dds_return_loan(hears, sample, 1);
    }
    dds_get_publication_matched_status(asking, &server);
    dds_get_subscription_matched_status(answers, &replier);
    if (!asked && server.current_count > 0 && replier.current_count > 0) {
      std_srvs_srv_dds__Trigger_Request_ request = {.guid = 7, .seq = 1};
      asked = dds_write(asking, &request) == 0;
    }
    sample[0] = NULL;
    while (dds_take(answers, sample, &info, 1, 1) > 0) {
      std_srvs_srv_dds__Trigger_Response_ *reply = sample[0];
      if (info.valid_data && reply->guid == 7) printf("answered %s\n", reply->message);
      dds_return_loan(answers, sample, 1);
    }
  }
}
