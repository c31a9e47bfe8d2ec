// Connections: the writers and readers that a node hands out, typed and raw.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "core/dds/command_gate.hpp"
#include "core/dds/local_exchange.hpp"
#include "core/dds/node.hpp"
#include "core/dds/participant.hpp"
#include "core/dds/wire_type.hpp"

namespace invar::dds {

/// A data writer of one type.
class WriterConnection final : public Connection, private fdds::DataWriterListener {
 public:
  WriterConnection(Participant& participant, const std::string& topic, const WireType& type,
                   const Profile& profile);
  ~WriterConnection() override;
  [[nodiscard]] fdds::DataWriter& writer() { return *writer_; }
  /// Readers connected now.
  [[nodiscard]] const std::atomic<std::int32_t>& readers() const { return readers_; }
  /// Set-up, before anything is written: which way samples go to readers of this PC; nullptr: by the middleware.
  [[nodiscard]] std::shared_ptr<LocalWriter> share(LocalExchange& exchange);

  [[nodiscard]] std::size_t matched() const override;
  [[nodiscard]] std::uint64_t lost() const override { return refused_; }
  bool write(const void* sample) override;
  bool wait_for_acknowledgments(Duration patience) override;
  void forget() override;

 private:
  void on_publication_matched(fdds::DataWriter*, const fdds::PublicationMatchedStatus& status) override;

  Participant& participant_;
  const WireType& type_;
  std::mutex local_mutex_;
  std::shared_ptr<LocalWriter> local_;
  std::set<EndpointId> matched_;
  std::atomic<std::int32_t> readers_{0};
  std::atomic<std::uint64_t> refused_{0};
  fdds::DataWriter* writer_;
};

/// A data reader whose listener hands over; what it does with the samples is given as a function, called on
/// threads of the middleware.
class ReaderConnection final : public Connection, private fdds::DataReaderListener {
 public:
  using Receive = std::function<void(fdds::DataReader& reader)>;
  ReaderConnection(Participant& participant, const std::string& topic, fdds::TopicDataType* type,
                   const Profile& profile, Discovery& discovery, Receive receive,
                   std::shared_ptr<CommandGate> gate = nullptr, std::shared_ptr<LocalReader> local = nullptr);
  ~ReaderConnection() override;

  [[nodiscard]] std::size_t matched() const override;
  [[nodiscard]] std::uint64_t lost() const override { return lost_ + (local_ ? local_->lost() : 0); }
  bool write(const void*) override { return false; }
  bool wait_for_acknowledgments(Duration) override { return true; }

 private:
  void on_data_available(fdds::DataReader* reader) override { receive_(*reader); }
  void on_subscription_matched(fdds::DataReader*, const fdds::SubscriptionMatchedStatus& status) override;
  void on_liveliness_changed(fdds::DataReader*, const fdds::LivelinessChangedStatus& status) override;
  void on_sample_lost(fdds::DataReader*, const fdds::SampleLostStatus& status) override {
    lost_ = static_cast<std::uint64_t>(status.total_count);
  }

  Participant& participant_;
  Discovery& discovery_;
  std::string topic_;
  Receive receive_;
  std::shared_ptr<CommandGate> gate_;
  std::shared_ptr<LocalReader> local_;
  std::mutex silent_mutex_;
  std::set<std::string> silent_;  // writers, told so
  std::atomic<std::int32_t> matched_{0};
  std::atomic<std::uint64_t> lost_{0};
  fdds::DataReader* reader_;
};

/// Writes bytes.
class RawWriterConnection final : public Connection {
 public:
  RawWriterConnection(Participant& participant, const std::string& topic, const std::string& type,
                      const Profile& profile);
  ~RawWriterConnection() override;
  [[nodiscard]] std::size_t matched() const override;
  [[nodiscard]] std::uint64_t lost() const override { return refused_; }
  bool write(const void* span) override;
  bool wait_for_acknowledgments(Duration patience) override;

 private:
  Participant& participant_;
  fdds::DataWriter* writer_;
  std::atomic<std::uint64_t> refused_{0};
};

/// The answer of a raw reader to each sample.
[[nodiscard]] ReaderConnection::Receive raw_receiver(std::function<void(const RawSample&)> take);

}  // namespace invar::dds
