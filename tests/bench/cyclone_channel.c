#include "cyclone_channel.h"

#include <dds/dds.h>

#include "stage.h"

static dds_entity_t writer_;
static cyclone_receive receive_;

static dds_entity_t topic_on(uint32_t domain, dds_entity_t* participant) {
  *participant = dds_create_participant(domain, NULL, NULL);
  return dds_create_topic(*participant, &invar_stage_AxisState_desc, "cyclone", NULL, NULL);
}

static dds_qos_t* realtime(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_deadline(qos, DDS_MSECS(100));
  return qos;
}

static void available(dds_entity_t reader, void* context) {
  void* samples[1] = {NULL};
  dds_sample_info_t info[1];
  while (dds_take(reader, samples, info, 1, 1) > 0) {
    if (info[0].valid_data) receive_(((const invar_stage_AxisState*)samples[0])->at.time_ns, context);
    dds_return_loan(reader, samples, 1);
  }
}

int cyclone_open_writer(uint32_t domain) {
  dds_entity_t participant;
  const dds_entity_t topic = topic_on(domain, &participant);
  dds_qos_t* qos = realtime();
  writer_ = dds_create_writer(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  return writer_ < 0;
}

int cyclone_open_reader(uint32_t domain, cyclone_receive receive, void* context) {
  dds_entity_t participant;
  const dds_entity_t topic = topic_on(domain, &participant);
  receive_ = receive;
  dds_listener_t* listener = dds_create_listener(context);
  dds_lset_data_available(listener, available);
  dds_qos_t* qos = realtime();
  const dds_entity_t reader = dds_create_reader(participant, topic, qos, listener);
  dds_delete_qos(qos);
  dds_delete_listener(listener);
  return reader < 0;
}

void cyclone_write(int64_t sent_ns) {
  invar_stage_AxisState sample = {0};
  sample.at.time_ns = sent_ns;
  dds_write(writer_, &sample);
}
