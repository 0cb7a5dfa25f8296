; cap: theory §2.7. E' <- min(E', S_cap + max(V_e, min(W_c, S_c))) stays a lower bound of E, and the
; credit beyond what the tissue stores is at most S_cap + S_c.
(set-logic QF_LRA)
(declare-const E Real)
(declare-const before Real)
(declare-const after Real)
(declare-const S Real)   ; S_cap
(declare-const Ve Real)
(declare-const W Real)
(declare-const Sc Real)
(define-fun lesser ((x Real) (y Real)) Real (ite (<= x y) x y))
(define-fun greater ((x Real) (y Real)) Real (ite (>= x y) x y))
(assert (and (> S 0) (>= Ve 0) (>= Sc 0)))
(assert (<= before E))  ; dropped in the twin
(assert (= after (lesser before (+ S (greater Ve (lesser W Sc))))))
(assert (or (> after E) (> (- after Ve) (+ S Sc))))  ; negated conclusion
(check-sat)
