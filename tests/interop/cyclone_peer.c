/* A program of a plant that uses Cyclone DDS and knows of Invar only its IDL and its QoS: reads loop, state and status
 * topics and sends commands. Arguments: domain, samples wanted of each topic, and optionally one wrong QoS:
 * "deadline" (asks for 1 ms) or "xcdr2". Prints what it got, one line a sample. */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "lifecycle.h"
#include "stage.h"
#include "thermal.h"

static dds_qos_t* realtime(dds_duration_t deadline) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_deadline(qos, deadline);
  return qos;
}

static dds_qos_t* state(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  return qos;
}

static dds_qos_t* command(void) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 200);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_ownership(qos, DDS_OWNERSHIP_EXCLUSIVE);
  dds_qset_ownership_strength(qos, 20);
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  dds_qset_lifespan(qos, DDS_SECS(1));
  return qos;
}

/* Takes the qos. */
static dds_entity_t reader(dds_entity_t participant, const dds_topic_descriptor_t* type, const char* name,
                           dds_qos_t* qos) {
  const dds_entity_t topic = dds_create_topic(participant, type, name, NULL, NULL);
  const dds_entity_t made = dds_create_reader(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  if (made < 0) fprintf(stderr, "%s: %s\n", name, dds_strretcode(-made));
  return made;
}

int main(int count, char** words) {
  if (count < 3) return 2;
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
  const int wanted = atoi(words[2]);
  const char* wrong = count > 3 ? words[3] : "";

  dds_qos_t* loop = realtime(strcmp(wrong, "deadline") == 0 ? DDS_MSECS(1) : DDS_MSECS(100));
  if (strcmp(wrong, "xcdr2") == 0)
    dds_qset_data_representation(loop, 1, (dds_data_representation_id_t[]){DDS_DATA_REPRESENTATION_XCDR2});
  const dds_entity_t states = reader(participant, &invar_stage_AxisState_desc, "cell/test/axis/state", loop);
  const dds_entity_t heats =
      reader(participant, &invar_thermal_NodeTemperature_desc, "cell/test/heat/node", state());
  const dds_entity_t components =
      reader(participant, &invar_lifecycle_ComponentStatus_desc, "cell/test/process/components", state());
  const dds_entity_t topic =
      dds_create_topic(participant, &invar_stage_AxisCommand_desc, "cell/test/axis/command", NULL, NULL);
  dds_qos_t* orders = command();
  const dds_entity_t writer = dds_create_writer(participant, topic, orders, NULL);
  dds_delete_qos(orders);

  int got_states = 0, got_heats = 0, got_components = 0, sent = 0;
  for (int i = 0; i < 1500 && (got_states < wanted || got_heats < 2 || got_components < 1 || sent < wanted);
       ++i) {
    void* samples[1];
    dds_sample_info_t info[1];
    for (samples[0] = NULL; dds_take(states, samples, info, 1, 1) > 0; dds_return_loan(states, samples, 1)) {
      const invar_stage_AxisState* s = samples[0];
      if (!info[0].valid_data) continue;
      printf("state %u %llu %.17g %d %d\n", s->axis, (unsigned long long)s->at.cycle, s->position,
             (int)s->mode, (int)s->settled);
      ++got_states;
    }
    for (samples[0] = NULL; dds_take(heats, samples, info, 1, 1) > 0; dds_return_loan(heats, samples, 1)) {
      const invar_thermal_NodeTemperature* t = samples[0];
      if (!info[0].valid_data) continue;
      printf("heat %u %.17g\n", t->node, t->temperature);
      ++got_heats;
    }
    for (samples[0] = NULL; dds_take(components, samples, info, 1, 1) > 0;
         dds_return_loan(components, samples, 1)) {
      const invar_lifecycle_ComponentStatus* c = samples[0];
      if (!info[0].valid_data) continue;
      printf("component %s %d %s\n", c->component_name, (int)c->state, c->failure);
      ++got_components;
    }
    dds_publication_matched_status_t matched;
    dds_get_publication_matched_status(writer, &matched);
    if (matched.current_count > 0) {
      invar_stage_AxisCommand order;
      memset(&order, 0, sizeof order);
      order.axis = 3;
      order.id = (uint64_t)++sent;
      order.kind = invar_stage_AXIS_COMMAND_MOVE;
      order.position = 0.125 * sent;
      dds_write(writer, &order);
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  printf("end %d %d %d %d\n", got_states, got_heats, got_components, sent);
  fflush(stdout);
  dds_sleepfor(DDS_MSECS(300)); /* for what is still to be sent again */
  dds_delete(participant);
  return 0;
}
