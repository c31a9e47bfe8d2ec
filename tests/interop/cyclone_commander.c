/* A plant's program that gives one command over Cyclone DDS and ends: cyclone_commander DOMAIN TOPIC STRENGTH ID clean|killed|held|twin.
 * It takes its leave, or kills itself, or stays for a minute, or that with a second participant that says nothing. */
#include <dds/dds.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "stage.h"

int main(int count, char** words) {
  if (count != 6) return 2;
  const dds_entity_t participant = dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
  const dds_entity_t topic =
      dds_create_topic(participant, &invar_stage_AxisCommand_desc, words[2], NULL, NULL);
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 200);
  dds_qset_durability(qos, DDS_DURABILITY_VOLATILE);
  dds_qset_ownership(qos, DDS_OWNERSHIP_EXCLUSIVE);
  dds_qset_ownership_strength(qos, atoi(words[3]));
  dds_qset_liveliness(qos, DDS_LIVELINESS_AUTOMATIC, DDS_SECS(2));
  dds_qset_lifespan(qos, DDS_SECS(1));
  const dds_entity_t writer = dds_create_writer(participant, topic, qos, NULL);
  dds_delete_qos(qos);
  dds_publication_matched_status_t matched = {0};
  for (int i = 0; i < 1000 && matched.current_count == 0; ++i) {
    dds_sleepfor(DDS_MSECS(10));
    dds_get_publication_matched_status(writer, &matched);
  }
  if (matched.current_count == 0) return 1;
  dds_sleepfor(DDS_MSECS(300)); /* the reader's side of the match */
  invar_stage_AxisCommand order;
  memset(&order, 0, sizeof order);
  order.axis = 3;
  order.id = strtoull(words[4], NULL, 10);
  order.kind = invar_stage_AXIS_COMMAND_MOVE;
  if (dds_write(writer, &order) != 0) return 1;
  (void)dds_wait_for_acks(writer, DDS_SECS(5));
  if (strcmp(words[5], "twin") == 0) {
    (void)dds_create_participant((dds_domainid_t)atoi(words[1]), NULL, NULL);
    dds_sleepfor(DDS_SECS(60));
  }
  if (strcmp(words[5], "held") == 0) dds_sleepfor(DDS_SECS(60));
  if (strcmp(words[5], "killed") == 0) raise(SIGKILL);
  dds_delete(participant);
  return 0;
}
