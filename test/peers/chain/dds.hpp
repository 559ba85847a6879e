// Readers and writers of Cyclone DDS with ROS's names and settings, for the chain's peer and observer.
#pragma once

#include <dds/dds.h>
#include <signal.h>
#include <time.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>

namespace chain {

[[noreturn]] inline void fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

inline dds_entity_t checked(dds_entity_t entity, const char* what) {
  if (entity < 0) fail(std::string(what) + ": " + dds_strretcode(entity));
  return entity;
}

// Arguments of the form --name value.
inline std::map<std::string, std::string> arguments(int argc, char** argv) {
  std::map<std::string, std::string> found;
  for (int i = 1; i + 1 < argc; i += 2) found[argv[i]] = argv[i + 1];
  return found;
}

inline dds_qos_t* reliable(int depth) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  const dds_data_representation_id_t plain = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos, 1, &plain);
  return qos;
}

inline dds_entity_t topic(dds_entity_t participant, const dds_topic_descriptor_t* type, const std::string& name) {
  return checked(dds_create_topic(participant, type, ("rt/" + name).c_str(), nullptr, nullptr), name.c_str());
}

inline dds_entity_t reader(dds_entity_t participant, const dds_topic_descriptor_t* type, const std::string& name, int depth) {
  dds_qos_t* qos = reliable(depth);
  const dds_entity_t made = dds_create_reader(participant, topic(participant, type, name), qos, nullptr);
  dds_delete_qos(qos);
  return checked(made, name.c_str());
}

inline dds_entity_t writer(dds_entity_t participant, const dds_topic_descriptor_t* type, const std::string& name, int depth) {
  dds_qos_t* qos = reliable(depth);
  const dds_entity_t made = dds_create_writer(participant, topic(participant, type, name), qos, nullptr);
  dds_delete_qos(qos);
  return checked(made, name.c_str());
}

inline double now_s() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// True from the first SIGTERM on.
inline volatile sig_atomic_t ended = 0;

inline void end_with_sigterm() {
  struct sigaction action = {};
  action.sa_handler = [](int) { ended = 1; };
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace chain
