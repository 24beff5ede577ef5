// SPDX-License-Identifier: MIT
#include "core/solve/sparse_cholesky.hpp"

#include <Eigen/SparseCholesky>
#include <algorithm>

#include "core/base/error.hpp"
#ifdef KERF_WITH_CHOLMOD
#include <cholmod.h>
#endif

namespace kerf {
namespace {

using SparseMap = Eigen::Map<const Eigen::SparseMatrix<double>>;

SparseMap view(const AssembledLevel& m) {
  const int n = m.unknowns();
  return {
      n, n, static_cast<int>(m.row.size()), m.column_begin.data(), m.row.data(), m.value.data()};
}

// A pivot is what is left of a diagonal entry when the unknowns before it are eliminated: its
// stiffness when they give way. Rounding leaves some 1e-16 of it where nothing holds the body;
// a beam 1000 times as long as thick still has 1e-10.
constexpr double kSingular = 1e-13;

bool is_pivot(double root, double diagonal) { return root * root > kSingular * diagonal; }

// One virtual step keeps the engines apart; both see the same assembled matrix.
struct Engine {
  virtual ~Engine() = default;
  virtual void analyse(const AssembledLevel& m) = 0;
  virtual bool factor(const AssembledLevel& m) = 0;
  virtual void solve(std::span<const double> right, std::span<double> solution) = 0;
  virtual std::size_t entries() const = 0;
};

struct EigenEngine final : Engine {
  void analyse(const AssembledLevel& m) override { llt.analyzePattern(view(m)); }
  bool factor(const AssembledLevel& m) override {
    llt.factorize(view(m));
    if (llt.info() != Eigen::Success) return false;
    const auto& L = llt.matrixL().nestedExpression();
    for (int i = 0; i < m.unknowns(); ++i) {
      const int at = llt.permutationP().size() > 0 ? llt.permutationP().indices()(i) : i;
      if (!is_pivot(L.valuePtr()[L.outerIndexPtr()[at]], m.value[m.column_begin[i]])) return false;
    }
    return true;
  }
  void solve(std::span<const double> right, std::span<double> solution) override {
    const auto n = static_cast<Eigen::Index>(right.size());
    Eigen::Map<Eigen::VectorXd>(solution.data(), n) =
        llt.solve(Eigen::Map<const Eigen::VectorXd>(right.data(), n));
  }
  std::size_t entries() const override { return static_cast<std::size_t>(llt.entries()); }

  /// Has room for its entries once it is analysed, when matrixL() must not be asked for yet.
  struct Llt : Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower> {
    Eigen::Index entries() const { return m_matrix.nonZeros(); }
  };
  Llt llt;
};

#ifdef KERF_WITH_CHOLMOD
struct CholmodEngine final : Engine {
  CholmodEngine() {
    cholmod_start(&common);
    common.supernodal = CHOLMOD_SUPERNODAL;
    common.final_ll = 1;
    common.print = 0;
  }
  ~CholmodEngine() override {
    cholmod_free_factor(&factor_, &common);
    cholmod_finish(&common);
  }
  CholmodEngine(const CholmodEngine&) = delete;
  CholmodEngine& operator=(const CholmodEngine&) = delete;

  static cholmod_sparse view_of(const AssembledLevel& m) {
    cholmod_sparse a{};
    a.nrow = a.ncol = static_cast<std::size_t>(m.unknowns());
    a.nzmax = m.row.size();
    // CHOLMOD reads these arrays and never writes them.
    a.p = const_cast<int*>(m.column_begin.data());
    a.i = const_cast<int*>(m.row.data());
    a.x = const_cast<double*>(m.value.data());
    a.stype = -1;
    a.itype = CHOLMOD_INT;
    a.xtype = CHOLMOD_REAL;
    a.dtype = CHOLMOD_DOUBLE;
    a.sorted = 1;
    a.packed = 1;
    return a;
  }
  void analyse(const AssembledLevel& m) override {
    cholmod_free_factor(&factor_, &common);
    cholmod_sparse a = view_of(m);
    factor_ = cholmod_analyze(&a, &common);
    check();
  }
  bool factor(const AssembledLevel& m) override {
    cholmod_sparse a = view_of(m);
    cholmod_factorize(&a, factor_, &common);
    if (common.status == CHOLMOD_NOT_POSDEF) return false;
    check();
    return factor_->minor == factor_->n && has_pivots(m);
  }
  void solve(std::span<const double> right, std::span<double> solution) override {
    cholmod_dense b{};
    b.nrow = b.d = b.nzmax = right.size();
    b.ncol = 1;
    b.x = const_cast<double*>(right.data());
    b.xtype = CHOLMOD_REAL;
    b.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor_, &b, &common);
    check();
    std::copy_n(static_cast<const double*>(x->x), solution.size(), solution.data());
    cholmod_free_dense(&x, &common);
  }
  std::size_t entries() const override { return static_cast<std::size_t>(common.lnz); }

  bool has_pivots(const AssembledLevel& m) const {
    ensures(factor_->is_super != 0, "CHOLMOD was asked for a supernodal factor");
    const auto* super = static_cast<const int*>(factor_->super);
    const auto* row_begin = static_cast<const int*>(factor_->pi);
    const auto* value_begin = static_cast<const int*>(factor_->px);
    const auto* order = static_cast<const int*>(factor_->Perm);
    const auto* value = static_cast<const double*>(factor_->x);
    for (std::size_t s = 0; s < factor_->nsuper; ++s) {
      const int rows = row_begin[s + 1] - row_begin[s];
      for (int k = 0; k < super[s + 1] - super[s]; ++k) {
        // Columns of a supernode lie one after another, each with all its rows.
        const double root = value[value_begin[s] + static_cast<std::ptrdiff_t>(k) * (rows + 1)];
        if (!is_pivot(root, m.value[m.column_begin[order[super[s] + k]]])) return false;
      }
    }
    return true;
  }
  void check() const {
    if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE)
      throw Error(ErrorKind::unavailable,
                  "out of memory in sparse Cholesky; set solver.method = \"cg\"");
    ensures(common.status >= CHOLMOD_OK, text("CHOLMOD status ", common.status));
  }
  cholmod_common common{};
  cholmod_factor* factor_ = nullptr;
};
#endif

std::unique_ptr<Engine> make_engine(CholeskyEngine engine) {
#ifdef KERF_WITH_CHOLMOD
  if (engine == CholeskyEngine::supernodal) return std::make_unique<CholmodEngine>();
#else
  static_cast<void>(engine);
#endif
  return std::make_unique<EigenEngine>();
}

}  // namespace

struct SparseCholesky::Impl {
  std::unique_ptr<Engine> engine;
};

SparseCholesky::SparseCholesky(CholeskyEngine engine)
    : impl_(std::make_unique<Impl>(Impl{make_engine(engine)})) {}

SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

void SparseCholesky::analyse(const AssembledLevel& matrix) { impl_->engine->analyse(matrix); }
bool SparseCholesky::factor(const AssembledLevel& matrix) { return impl_->engine->factor(matrix); }
void SparseCholesky::solve(std::span<const double> right, std::span<double> solution) const {
  impl_->engine->solve(right, solution);
}
std::size_t SparseCholesky::factor_entries() const { return impl_->engine->entries(); }

std::string supernodal_engine_name() {
#ifdef KERF_WITH_CHOLMOD
  return text("CHOLMOD ", CHOLMOD_MAIN_VERSION, '.', CHOLMOD_SUB_VERSION, '.',
              CHOLMOD_SUBSUB_VERSION);
#else
  return "Eigen";
#endif
}

}  // namespace kerf
