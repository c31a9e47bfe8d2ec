// Search: forward selection of terms with a strict test of each, then elimination, curves for what has no name, held-out
// stretches and the verdict. Its steps stand in files of their own: prepare.cpp, naming.cpp, restarts.cpp, applied_current.cpp.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/diagnosis/evidence/loop_noise.hpp"
#include "core/diagnosis/evidence/other_cause.hpp"
#include "core/diagnosis/search/among_names.hpp"
#include "core/diagnosis/search/not_tried.hpp"
#include "core/diagnosis/search/one_name.hpp"
#include "core/diagnosis/search/options.hpp"
#include "core/diagnosis/thresholds.hpp"

namespace invar::diagnosis {

/// Share in 0..1 that is done, and the step that is begun.
using Progress = std::function<void(double, const std::string&)>;

class Search {
 public:
  Search(Case& data, const Progress& progress, const Options& options)
      : data_{data}, progress_{progress}, options_{options} {}
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  Diagnosis run();

 private:
  /// The model fitted to the readings without those that stand far from their neighbours.
  void begin();
  void prepare();
  /// The model from which a name is sought: the best one under the filters of its residual or with every row alike. Where the
  /// missing effect led the user's numbers astray, the believed model.
  enum class From { coloured, plain, believed };
  struct Sought {
    Fit base;
    std::vector<Fit> fits;  // the short list
    std::optional<OneName> best;
  };
  Sought seek(From from, double share);
  /// Why a name that pays is not claimed beside others.
  std::optional<std::string> why_not(const OneName& name);
  bool add_named(double round);
  std::string why_it_does_not_pay(double evidence) const;
  /// Does a name do no more than lead the user's numbers out of a valley in which they were stuck (a pendulum that went over
  /// the top)? Then the search goes on from there. Asked once.
  bool leads_out(const OneName& name);
  void claim(Sought sought);
  /// In a window of its own friction looks like a motor without force. From numbers far astray the missing effect
  /// may look like its own opposite: from there no name is found.
  [[nodiscard]] bool may_lead_astray(const Fit& fit) const {
    return (data_.model.plant == physics::Plant::axis && data_.windows.count > 0) ||
           (data_.model.plant == physics::Plant::error_map && excursion_of(fit) > thresholds::map_astray);
  }
  /// Two terms at once, where neither does anything alone. `rival`: what the search one by one came to.
  bool add_pair(const Fit* rival = nullptr);
  /// Where a pair leads the user's numbers far astray: one name that does better from what he believes, in its place.
  bool put_one_in_place(const Diagnosis& begun);
  /// Claims friction, play or a dead zone that the noise shakes loose, where it explains more than what leads without noise
  /// (null: nothing does). Where that is the same, it gets its size under noise and is left to be claimed.
  bool take_shaken(const Fit& base, Fit* otherwise);
  /// Names one by one, weighed against each other, on top of what is claimed.
  void name(int first_round);
  /// Courses without a name, the test on held-out stretches, and the verdict.
  void finish();
  /// Where names one by one leave a rest or none is found: begins anew with two at once and keeps what explains more.
  void try_pairs(const Diagnosis& begun);
  /// Where names lead the user's numbers far astray: begins anew with one that is sought from what he believes.
  void try_believed(const Diagnosis& begun);
  /// Where the chief effect is a power of a variable in equations: begins anew with another power in its place. An
  /// effect still missing beside it (friction beside a drag) makes one look like the other.
  void try_other_power(const Diagnosis& begun);
  /// Begins anew with what `start` claims, goes on from round `next` and keeps what is `better` than before.
  template <class Start, class Better>
  void begin_anew(const Diagnosis& begun, int next, Start start, Better better);
  /// Is most of what there is to explain that the machine's controller is another than the model's?
  bool is_another_controller();
  /// The verdict then says nothing of the physics behind the controller.
  void stop_at_the_law();
  void say_controller();
  /// Claims what stands in the recorded current beside the law; false: nothing does.
  bool add_applied();
  /// Takes off the readings what their noise makes of the claims so far, and fits anew. The share of rows that it leaves to
  /// chance.
  double quieten();
  /// The same until the strengths stay: what noise makes of a bend goes with its size, which a fit to readings that still
  /// hold it takes too small.
  void settle();
  /// Holds the model out: on the readings that it was fitted to, and told of those recorded.
  void check(Claims claims);
  /// Takes a step; one that is interrupted counts for nothing, so that nothing is claimed on half a fit. False: not taken,
  /// or the step says so.
  template <class Step>
  bool take(const std::string& what, Step step) {
    if (was_stopped(what)) return false;
    const auto kept = std::tuple{d_, rivals_};
    const auto readings = noise_->now();
    if (const auto done = unless_stopped(options_.stop, step)) return *done;
    std::tie(d_, rivals_) = kept;
    noise_->put(readings);
    beside_.reset();
    leave(what);
    return false;
  }
  [[nodiscard]] bool stopped() const { return options_.stop.stop_requested(); }
  void leave(const std::string& what) { add_once(not_tried_, what); }
  /// Is it over? Then `what` is not tried.
  [[nodiscard]] bool was_stopped(const std::string& what) {
    const bool is_over = stopped();
    if (is_over) leave(what);
    return is_over;
  }
  [[nodiscard]] double margin() const { return options_.refuses ? claim_margin_of(d_.weighing) : 0.0; }
  [[nodiscard]] bool is_heat() const { return data_.model.plant == physics::Plant::thermal; }
  [[nodiscard]] bool is_equations() const { return data_.model.plant == physics::Plant::equations; }
  [[nodiscard]] std::size_t given() const { return data_.model.terms.size(); }

  Case& data_;
  const Progress& progress_;
  const Options& options_;
  Diagnosis d_;
  Rivals rivals_;
  std::vector<Screened> last_screen_;
  std::vector<physics::Model> alone_;  // with one term, found in short windows or by a pair that was tried
  std::optional<LoopNoise> noise_;
  bool led_out_ = false;
  std::optional<Beside> beside_;  // of the best model, once it was looked for
  std::vector<std::string> not_tried_;
};

}  // namespace invar::diagnosis
