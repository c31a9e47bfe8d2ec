// Every threshold that decides in a diagnosis, with where it comes from: a standard, statistics, an instrument, a measurement by a
// bench, or judgement where nothing better is known. Constants of numerical methods (grids, rounding, steps of a minimiser)
// stand beside their use.
#pragma once

#include <cstddef>

namespace invar::diagnosis::thresholds {

// --- checks: is it the recording, the units, the controller?

/// Ratio of the RMS in SI to the RMS in the column's own unit. Judgement.
inline constexpr double far_worse_in_si = 5.0;
/// Share of the spread that a model leaves which follows a recording. Judgement.
inline constexpr double follows_share = 0.2;
/// The same share for a model whose numbers may give way. Judgement.
inline constexpr double follows_share_retuned = 0.2;
/// Rows that are enough to know a clock by. Cost.
inline constexpr std::size_t rows_of_a_clock = 3000;
/// Sigmas of the user within which a number is near what he believes. Statistics: 99.7 %.
inline constexpr double near_sigmas = 3.0;
/// Ratio of what the time as read leaves to what another time leaves. Judgement.
inline constexpr double clock_times_worse = 5.0;
/// Rows of each of the 20 blocks that judge a controller's law. Statistics: an RMS of 50 rows is known to a
/// tenth.
inline constexpr std::ptrdiff_t rows_of_law_block = 50;
/// Cycles by which a command may come late. Judgement: 30 ms at 1 kHz, more than bus and drive take.
inline constexpr std::size_t most_cycles_late = 30;
/// Ratio to the squares that go with the instruments by chance. Judgement.
inline constexpr double late_beyond_chance = 4.0;
/// Share of the squares beyond noise that a late command may leave. Judgement.
inline constexpr double late_leaves = 0.2;
/// Rows without which nothing is said of a loop: 20 blocks of 50 rows.
inline constexpr std::size_t fewest_rows_of_law = 1000;
/// Share of the squares beyond noise that one kind of addition must take: most of it. Judgement.
inline constexpr double added_explains = 0.5;
/// [log likelihood] Gain over noise: the margin of a claim, and the places that a wave was looked for in.
/// Judgement.
inline constexpr double added_gain = 30.0;
/// Share of the range below which steps are no physics of a drive. Instrument: 14 bits are 6e-5 of the
/// range.
inline constexpr double finest_steps = 2e-4;
/// Rows beyond a limit without which it is not said. Judgement.
inline constexpr double limited_rows = 30.0;
/// Ratio of the squares of current and command beyond the limit. Judgement.
inline constexpr double limited_far_less = 0.1;
/// Share of the foretold change that the current must show. Judgement.
inline constexpr double added_at_least = 0.5;
/// [steps] RMS distance from the nearest step. Statistics: it is 0.29 for values anywhere between two
/// steps.
inline constexpr double nearer_to_steps = 0.2;
/// Share of the squares of a current. Instrument: no ammeter reads a hundred-thousandth.
inline constexpr double current_rounding = 1e-10;
/// Share of the force of an addition that the carriage feels. Judgement.
inline constexpr double added_is_felt = 0.5;

// --- estimate: priors and noise

/// Ratio to the instrument's noise above which a residual is mismatch, whatever its colour. Set by the
/// invariants of a diagnosis (docs/explanation/diagnosis.md).
inline constexpr double times_noise = 2.0;
/// Degrees of freedom of Student's t for what users believe. Statistics: one number far off is likelier
/// than several a little off; 3 is the fewest with a variance.
inline constexpr double belief_freedom = 3.0;
/// Sigma of the difference of two neighbouring knots that no row visits, over the sigma of one knot.
/// Judgement.
inline constexpr double neighbour_share = 0.1;
/// Sigmas of the user beyond which a number went astray. Measured: none of 150 right names on machines of
/// two authors led a number so far.
inline constexpr double far_astray = 10.0;
/// Relative distance from a harmonic of 50 or 60 Hz. Judgement.
inline constexpr double at_the_mains = 0.003;
/// [log odds] A sine is a current at the mains' frequencies, and a force elsewhere. Judgement: 50 to 1.
inline constexpr double current_or_force = 4.0;
/// [log odds] Against a law that few machines have. Judgement: 20 to 1.
inline constexpr double rare_law = 3.0;
/// Share of the logarithm of the rows that a frequency costs, since it was looked for in many places.
/// Judgement.
inline constexpr double look_elsewhere = 0.7;

// --- evidence: what may be claimed

/// Log evidence by which a term must win before it is claimed. Statistics: e^10 is 22,000 to 1, beside the
/// many terms, places and starts that are tried.
inline constexpr double claim_margin = 10.0;
/// Log evidence that each row adds to that margin, since many rows make a trifle significant. Judgement.
inline constexpr double margin_by_row = 0.001;
/// Margins that a further claim needs which hardly moves the size of the residual. Measured: more than
/// three missed effects of 455 and 991 nats (bench_mismatch --plants axis --each 0 --pairs 12 --seed 51).
inline constexpr double margins_of_a_trifle = 3.0;
/// Margins of such a claim beside white noise. Judgement.
inline constexpr double white_margins = 2.0;
/// Share of the evidence that independent rows confirm where noise is white. Judgement.
inline constexpr double white_share = 0.7;
/// Share of the squares beyond noise that a name takes on rows that no fit saw. Judgement: a sixth of the
/// RMS.
inline constexpr double foretold_share = 0.3;
/// Share of the gain of a free course that a name over the same variable may leave: its form is idealised,
/// and small effects go with that variable too. Judgement.
inline constexpr double of_form = 0.3;
/// Share of an RMS: an effect that takes half of the squares is no noise, whatever its colour, outside a
/// loop that feeds noise back.
inline constexpr double half_of_squares = 0.7;
/// Share of the mismatch's power below which nothing is claimed beside others: a percent of its size.
/// Judgement.
inline constexpr double trifle_of_power = 1e-4;
/// Sigmas of a bend's size under noise. Statistics: 99.7 %.
inline constexpr double shaken_sure = 3.0;
/// Sigmas for a first, rough look that must miss nothing. Judgement.
inline constexpr double shaken_perhaps = 1.0;
/// Readings for each free number. Rule of thumb of regression: 10 to 20.
inline constexpr double rows_a_number = 14.0;
/// Share of the largest speed with which a motion goes to a side. Judgement: beyond noise.
inline constexpr double goes_both_ways = 0.03;
/// Sigmas by which an amplitude differs from zero. Statistics: 99.7 %.
inline constexpr double sure_sigmas = 3.0;
/// Share of its width by which an error turns with the direction of approach. Judgement.
inline constexpr double play_turns = 0.5;
/// Share of a signal that passes a store by where the whole goes through it. Judgement.
inline constexpr double whole_store = 0.05;
/// Share of an upper bound from which on a number stands at it. Judgement.
inline constexpr double at_upper_bound = 0.99;
/// Damping ratio below which a mode rings. Physics: at 0.5 it overshoots by a sixth.
inline constexpr double rings_long = 0.5;
/// Ratio to a lower bound up to which a shape stands at it. Judgement.
inline constexpr double at_lower_bound = 1.3;
/// Share of an overflow below which nothing arrives elsewhere. Judgement.
inline constexpr double arrives_elsewhere = 0.05;
/// Ratio of friction at rest to friction at speed below which it is Coulomb's. Judgement.
inline constexpr double falls_at_least = 1.1;
/// Waves over the way of an axis, where a free course over the position is tried in their place. Judgement.
inline constexpr double waves_seen_on_axis = 1.5;
/// Waves without which an effect is any bent course. Judgement.
inline constexpr double waves_seen = 2.0;
/// Rows at a limit: a limit that fewer touch is an outlier. Judgement.
inline constexpr std::size_t rows_at_a_limit = 5;
/// Odds of another cause with which a name is rather wrong than right.
inline constexpr double unlikely_odds = 1.0;
/// Share of the mismatch beyond noise: a name that leaves more is unlikely by that alone. Judgement.
inline constexpr double plain_rest = 0.08;
/// Ratio of stiffnesses: such bristles cannot be told from sliding at once. Judgement.
inline constexpr double stiff_as_sliding = 10.0;
/// Odds of another cause at a gain of 100 nats. Fitted by tests/bench/mismatch_reliability.py, as are the
/// next five numbers.
inline constexpr double other_cause_at_100 = 0.062;
/// Exponent with which these odds fall as the gain grows.
inline constexpr double other_cause_slope = 0.315;
/// Odds for the share that is left and follows the recording. Synthetic machines ask for 3; public recordings, where more is
/// left and names are wrong more often, for 28. This stands between.
inline constexpr double other_cause_by_left = 14.0;
/// Odds for a freer shape that explains more.
inline constexpr double other_cause_by_shape = 0.285;
/// Share of the squares up to which such a shape is a matter of form.
inline constexpr double other_cause_form = 0.005;
/// Share that the idealised form of other names may leave.
inline constexpr double other_cause_ideal = 5e-4;
/// Most odds that numbers led astray add: a sigma that is too small alone takes no name away. Judgement.
inline constexpr double other_cause_by_excursion = 3.0;
/// Correlation from which on two inputs run alike. Judgement: four fifths of the one's power go with the other.
inline constexpr double runs_alike = 0.9;
/// Odds that an effect is none whose size is zero within its sigma. Judgement: 3 to 1.
inline constexpr double odds_of_zero = 3.0;
/// Share of a name's gain that an output must have to judge its rest. Judgement.
inline constexpr double part_of_gain = 0.1;
/// Highest probability of a name: 1 in 200 is left for causes that nobody thought of. Judgement.
inline constexpr double surest = 0.995;
/// Ratio to the scatter of a loop without bends: where runs scatter more, chance decides a row. Judgement.
inline constexpr double told_scatter = 4.0;
/// Share of the rows left to chance beyond which nothing would be left to judge by. Judgement.
inline constexpr double most_left_to_chance = 0.9;
/// Share of an RMS in a run without noise, where a shaken carriage sticks here and slips there. Judgement.
inline constexpr double plain_without_noise = 0.8;
/// Share of the gain that the best stretch alone may bring to a wave that lasts. Judgement.
inline constexpr double lasts_share = 0.6;
/// Share of a wave that the rounding of a reading would make itself. Judgement.
inline constexpr double rounding_share = 0.4;
/// [nats] Price of a term in what is detectable: the margin of a claim, and its numbers. Judgement.
inline constexpr double price_of_a_term = 12.0;
/// Share of an RMS that a first name may leave in a loop. Judgement: half a percent shows in the residual.
inline constexpr double seen_first = 0.995;
/// Rows of an instrument that would show that it wanders. Judgement.
inline constexpr std::size_t rows_that_show_wander = 1500;

/// Share of a residual's power that the steps of a reading make: enough to draw a saw over the output. Judgement.
inline constexpr double made_by_rounding = 0.25;
/// Correlation of a residual's power with the reading: noise of an instrument grows with it. That of a jitter of time goes with
/// the speed. Judgement.
inline constexpr double goes_with_reading = 0.8;
/// Sigmas, and share, of what neighbouring loud rows have in common. White noise that is louder there has neither. Judgement.
inline constexpr double related_sigmas = 4.0;
inline constexpr double related_share = 0.1;

// --- search: what is kept, and the verdict

/// Ratio of two RMS on rows that no fit saw. Statistics: the RMS of fifty independent values is uncertain
/// by a tenth, and few recordings hold more of them.
inline constexpr double worse_by_chance = 1.1;
/// Share of the noise's power: a change within half the noise cannot be told from it.
inline constexpr double within_noise = 0.25;
/// Ratio of two RMS: an output that is half as bad again is seen by everybody, whatever the others gain.
/// Judgement.
inline constexpr double plainly_worse = 1.5;
/// Share of a residual's power: a thousandth of its size changes nothing that anybody could see. Judgement.
inline constexpr double does_nothing = 1e-6;
/// Held-out readings of an output that is compared. Judgement: a start value alone is compared with
/// nothing.
inline constexpr double held_out_readings = 8.0;
/// Log likelihood of the held-out rows that a claim must gain. Statistics: 20 to 1.
inline constexpr double held_out_gain = 3.0;
/// Sigmas of the user beyond which a number moved. Statistics: 99.7 %.
inline constexpr double moved_sigmas = 3.0;
/// Share of the mismatch that a name may leave which explains it. Judgement.
inline constexpr double little_left = 0.05;
/// Share of a residual's power that follows the recording. Measured: no more than a hundredth where nothing
/// is missing, on 150 recordings of machines of two authors.
inline constexpr double plainly_followed = 0.1;
/// Ratio of the power beyond the user's noise to that noise: names are doubted. Judgement.
inline constexpr double far_above_given_noise = 0.5;
/// Ratio to what does not follow the recording: names are doubted. Judgement.
inline constexpr double far_above_unrelated = 3.0;
/// Noise of a residual beyond which it strays far where no name is found, since noise wanders. Judgement.
inline constexpr double wanders_far = 5.0;
/// The same beside a name, which leaves little where it is right. Judgement.
inline constexpr double wanders_far_beside_a_name = 3.0;
/// Ratio to the change from row to row: a run goes another way than the machine. Judgement.
inline constexpr double goes_another_way = 20.0;
/// Share of an RMS that numbers from another valley may leave. Judgement.
inline constexpr double other_valley = 0.5;
/// Values of an output in another recording; the start alone is none. Judgement.
inline constexpr std::size_t values_to_compare = 8;
/// Below so many rows of all recordings a run of equations is quick. Judgement: pairs of terms had this bound.
inline constexpr std::size_t quick_rows = 8000;
/// Share of an RMS that each of two terms may leave beside the other. Judgement.
inline constexpr double pair_adds = 0.8;
/// Ratio to the noise where a name must be likelier than not. Judgement.
inline constexpr double very_far_above_noise = 10.0;
/// Least probability of a name that is said there,
inline constexpr double said_very_far = 0.65;
/// where the model is far off or the user's numbers went astray,
inline constexpr double said_far = 0.45;
/// and anywhere. Judgement: a name that is less likely misleads.
inline constexpr double said_at_all = 0.2;
/// Margins that a curve without a name needs, since it is tried over many variables. Judgement.
inline constexpr double nameless_margins = 2.0;
/// Share of the noise from row to row that a median must take off an input. Judgement.
inline constexpr double input_noise_anew = 0.5;
/// [log odds] A force that repeats in time against one along the way at a steady speed, where they look
/// alike. Judgement.
inline constexpr double odds_of_twins = -1.0;
/// Share of an RMS: a smaller gain does not tell such twins apart beside a large rest. Judgement.
inline constexpr double told_by_a_tenth = 0.9;
/// Share of an RMS that a further name may leave: a twentieth is seen. Judgement.
inline constexpr double seen_further = 0.95;
/// [log odds] Lead of a rival that takes the place of a name. Judgement.
inline constexpr double better_after_all = 0.5;
/// Ratio of the squares that a recording leaves which is read otherwise. Judgement.
inline constexpr double other_reading_leaves = 0.7;
/// Ratio of the squares once a column is moved by whole rows: half the RMS. Judgement.
inline constexpr double moved_column_leaves = 0.25;
/// Share of an RMS that a curve without a name may leave alone. Judgement: an engineer sees it.
inline constexpr double seen_alone = 0.985;
/// The same beside names. Judgement: a tenth.
inline constexpr double seen_beside = 0.9;
/// Share of the mismatch, against that of the chief effect, below which rivals of a finding leave the verdict as it is.
/// Judgement: a tenth.
inline constexpr double small_beside_chief = 0.1;
/// Share of an RMS that a fit with all rows alike leaves of one under filters, below which the filters lead away. Judgement: a
/// tenth.
inline constexpr double leads_away = 0.9;
/// The same of a curve without a name, which follows more easily. Judgement.
inline constexpr double leads_a_curve_away = 0.97;
/// Share of an RMS that a curve with memory may leave: it takes a little of nearly any dynamics. Judgement.
inline constexpr double memory_leaves = 0.9;
/// The same beside the best curve without memory. Judgement.
inline constexpr double memory_leaves_beside_curve = 0.8;
/// Share of its gain by which a curve must beat the name in whose place it stands. Judgement.
inline constexpr double curve_over_name = 0.25;
/// Margins of evidence of a name that plainly foretells rows that no fit saw: enough for a further claim.
/// Judgement.
inline constexpr double foretold_margins = 3.5;
/// Margins of a wave in a loop, which was looked for at many frequencies. 120 axes without a fault: no claim.
inline constexpr double wave_margins = 2.0;
/// Margins of any other name in a loop. Judgement.
inline constexpr double loop_margins = 1.1;
/// Sigmas of the user in an error map beyond which names are sought from what he believes as well.
/// Judgement.
inline constexpr double map_astray = 5.0;

// --- report: what is said

/// Ratio of a stated noise to the whole residual. Judgement: a sigma may be taken with care, not five times too large.
inline constexpr double noise_overstated = 5.0;

/// Probability that something is missing at the controller, where the current is not what its law makes. Judgement.
inline constexpr double sure_of_its_place = 0.9;
/// Probability of a place where neither a name nor a curve explains anything. Measured: right in two of five public recordings.
inline constexpr double place_alone = 0.4;
/// Sigmas of the user beyond which the model has become another. Judgement.
inline constexpr double far_moved = 10.0;
/// Ratio to the noise that is said beside the verdict. Judgement.
inline constexpr double much_left = 3.0;
/// One reading in so many: more outliers are said, since a slip of an instrument is rarer. Judgement.
inline constexpr std::size_t one_in_outliers = 20;
/// Ratio to the noise, and of the unit. Instrument: an error of a machine is known to one in a million at
/// best.
inline constexpr double runs_away = 1e6;
/// Value in any unit at which a model has left. Judgement.
inline constexpr double nowhere = 1e30;
/// Ratio to the noise: where more is left, the missing physics moved the numbers, and no slip in a file.
/// Judgement.
inline constexpr double slip_unless_left = 3.0;

}  // namespace invar::diagnosis::thresholds
