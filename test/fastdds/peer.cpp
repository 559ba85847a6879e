// A participant of eProsima Fast DDS that knows of Lattice only names and bytes.
//
//   peer DOMAIN talk       says words on rt/heard until each has come back on rt/said, and reads rt/map
//   peer DOMAIN ask COUNT  asks the service /server/reset, each time as a fresh client
//
// On loopback without multicast. Prints one line of JSON; ends with a message and 1 after a minute in vain.

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <iostream>
#include <mutex>
#include <string>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using namespace eprosima::fastrtps::rtps;
using Clock = std::chrono::steady_clock;
using Bytes = std::vector<uint8_t>;

constexpr auto PATIENCE = std::chrono::minutes(1);
constexpr uint32_t MAX_BYTES = 4 << 20;

[[noreturn]] void die(const std::string& words) {
  std::cerr << "fastdds peer: " << words << std::endl;
  std::_Exit(1);
}

// A type of any name, as the bytes that it has on the wire, encapsulation included.
struct RawType : TopicDataType {
  explicit RawType(const char* name) {
    setName(name);
    m_typeSize = MAX_BYTES;
    m_isGetKeyDefined = false;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<Bytes*>(data);
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

// std_msgs/String in CDR, little-endian.
Bytes string(const std::string& text) {
  const auto length = static_cast<uint32_t>(text.size() + 1);
  Bytes bytes{0, 1, 0, 0};
  for (int i = 0; i < 4; i++) bytes.push_back(static_cast<uint8_t>(length >> (8 * i)));
  bytes.insert(bytes.end(), text.begin(), text.end());
  bytes.push_back(0);
  return bytes;
}

// The same message: a sender may pad it to four bytes, and says so in the fourth.
bool same(const Bytes& sent, const Bytes& heard) {
  return heard.size() >= sent.size() && heard.size() < sent.size() + 4 &&
         std::equal(sent.begin() + 4, sent.end(), heard.begin() + 4);
}

struct Heard {
  Bytes bytes;
  SampleIdentity answers;
};

// What listeners see, for one thread that waits.
struct Events {
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<Heard> heard;
  int readers = 0, writers = 0;

  template <typename Reached>
  void until(Reached reached, const char* what) {
    std::unique_lock<std::mutex> lock(mutex);
    if (!changed.wait_for(lock, PATIENCE, reached)) die(std::string("waited in vain for ") + what);
  }
  template <typename Change>
  void change(Change how) {
    std::lock_guard<std::mutex> lock(mutex);
    how();
    changed.notify_all();
  }
  Heard next(const char* what) {
    until([this] { return !heard.empty(); }, what);
    std::lock_guard<std::mutex> lock(mutex);
    Heard first = std::move(heard.front());
    heard.pop_front();
    return first;
  }
};

struct WriterEvents : DataWriterListener {
  explicit WriterEvents(Events& events) : events(events) {}
  void on_publication_matched(DataWriter*, const PublicationMatchedStatus& status) override {
    events.change([&] { events.readers = status.current_count; });
  }
  Events& events;
};

struct ReaderEvents : DataReaderListener {
  explicit ReaderEvents(Events& events) : events(events) {}
  void on_subscription_matched(DataReader*, const SubscriptionMatchedStatus& status) override {
    events.change([&] { events.writers = status.current_count; });
  }
  void on_data_available(DataReader* reader) override {
    Bytes bytes;
    SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) {
        events.change([&] { events.heard.push_back({bytes, info.related_sample_identity}); });
      }
    }
  }
  Events& events;
};

DomainParticipant* join(int domain) {
  DomainParticipantQos qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  // Its default loses most of a large sample, which RustDDS then repairs in 12 s.
  udp->receiveBufferSize = MAX_BYTES;
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  // Every participant on this machine that may be there: ports as RTPS 2.2, 9.6.1.1 gives them.
  for (uint32_t number = 0; number < 20; number++) {
    Locator_t locator;
    IPLocator::setIPv4(locator, 127, 0, 0, 1);
    locator.port = 7400 + 250 * domain + 10 + 2 * number;
    qos.wire_protocol().builtin.initialPeersList.push_back(locator);
  }
  auto* participant = DomainParticipantFactory::get_instance()->create_participant(domain, qos);
  if (!participant) die("no participant");
  return participant;
}

Topic* topic(DomainParticipant* participant, const char* name, const char* type_name) {
  TypeSupport type(new RawType(type_name));
  type.register_type(participant);
  auto* made = participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
  if (!made) die(std::string("no topic ") + name);
  return made;
}

DataWriter* writer(Publisher* publisher, Topic* topic, WriterEvents& events) {
  DataWriterQos qos;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.reliable_writer_qos().times.heartbeatPeriod = {0, 100'000'000};
  qos.history().depth = 100;
  qos.endpoint().history_memory_policy = DYNAMIC_RESERVE_MEMORY_MODE;
  // Samples above 64 kB go out as fragments.
  qos.publish_mode().kind = ASYNCHRONOUS_PUBLISH_MODE;
  return publisher->create_datawriter(topic, qos, &events);
}

DataReader* reader(Subscriber* subscriber, Topic* topic, ReaderEvents& events, bool latched) {
  DataReaderQos qos;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().depth = 100;
  qos.endpoint().history_memory_policy = DYNAMIC_RESERVE_MEMORY_MODE;
  return subscriber->create_datareader(topic, qos, &events);
}

int talk(DomainParticipant* participant) {
  const char* type = "std_msgs::msg::dds_::String_";
  auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  Events to, from, latched;
  WriterEvents on_writer(to);
  ReaderEvents on_reader(from), on_map(latched);
  auto* out = writer(publisher, topic(participant, "rt/heard", type), on_writer);
  reader(subscriber, topic(participant, "rt/said", type), on_reader, false);
  to.until([&] { return to.readers > 0; }, "a reader of rt/heard");
  from.until([&] { return from.writers > 0; }, "a writer of rt/said");
  // Who says it again may not know our reader yet: the first word goes out until it is back.
  Bytes first = string("first");
  for (auto end = Clock::now() + PATIENCE;;) {
    out->write(&first);
    std::unique_lock<std::mutex> lock(from.mutex);
    const auto heard = [&] { return !from.heard.empty(); };
    if (from.changed.wait_for(lock, std::chrono::seconds(1), heard)) break;
    if (Clock::now() > end) die("nothing comes back");
  }
  // A volatile reader of Cyclone takes a large sample that is half there at the first heartbeat for history.
  if (out->wait_for_acknowledgments({60, 0}) != ReturnCode_t::RETCODE_OK) die("no acknowledgment");
  std::vector<std::string> words{"", "word"};
  for (size_t size : {60000, 65536, 2000000}) words.push_back(std::string(size, 'x'));
  for (int number = 0; number < 100; number++) words.push_back(std::to_string(number));
  for (const auto& word : words) {
    Bytes sent = string(word);
    if (!out->write(&sent)) die("cannot write");
    for (;;) {
      const Bytes heard = from.next(("the echo of " + std::to_string(word.size()) + " bytes").c_str()).bytes;
      if (same(sent, heard)) break;
      if (!same(first, heard)) die("another word came back");
    }
  }
  reader(subscriber, topic(participant, "rt/map", type), on_map, true);
  const bool map = same(string("map"), latched.next("what is latched").bytes);
  std::cout << "{\"echoed\": " << words.size() << ", \"latched\": " << (map ? "true" : "false") << "}\n";
  return 0;
}

// Time from the request to its reply, s. The client is as rmw_fastrtps's: the request tells the GUID of
// the reply's reader.
double ask(int domain) {
  auto* participant = join(domain);
  auto* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  auto* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  Events to, from;
  WriterEvents on_writer(to);
  ReaderEvents on_reader(from);
  auto* request_topic = topic(participant, "rq/server/resetRequest", "std_srvs::srv::dds_::Trigger_Request_");
  auto* reply_topic = topic(participant, "rr/server/resetReply", "std_srvs::srv::dds_::Trigger_Response_");
  auto* replies = reader(subscriber, reply_topic, on_reader, false);
  auto* requests = writer(publisher, request_topic, on_writer);
  to.until([&] { return to.readers > 0; }, "the server");
  from.until([&] { return from.writers > 0; }, "the writer of replies");
  const auto start = Clock::now();
  Bytes request{0, 1, 0, 0, 0};
  WriteParams params;
  params.related_sample_identity().writer_guid(replies->guid());
  if (!requests->write(&request, params)) die("cannot ask");
  const auto number = params.sample_identity().sequence_number();
  const Heard reply = from.next("a reply");
  const auto& answers = reply.answers;
  const bool ours = answers.writer_guid() == replies->guid() || answers.writer_guid() == requests->guid();
  if (!ours || answers.sequence_number() != number) die("the reply is to another request");
  if (reply.bytes.size() < 5 || reply.bytes[4] != 1) die("the reply is not `true`");
  const std::chrono::duration<double> taken = Clock::now() - start;
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
  return taken.count();
}

int main(int argc, char** argv) {
  if (argc == 3 && std::string(argv[2]) == "talk") return talk(join(std::atoi(argv[1])));
  if (argc != 4 || std::string(argv[2]) != "ask") die("peer DOMAIN talk | peer DOMAIN ask COUNT");
  std::vector<double> times;
  for (int left = std::atoi(argv[3]); left > 0; left--) times.push_back(ask(std::atoi(argv[1])));
  std::sort(times.begin(), times.end());
  if (times.empty()) die("nothing to ask");
  std::cout << "{\"median_s\": " << times[times.size() / 2] << ", \"max_s\": " << times.back() << "}\n";
  return 0;
}
